// Made of docs/openapi.json by npm run types.
export type paths = Record<string, never>;
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /** @description A joint that is not there. */
        AbsentJoint: {
            /**
             * Format: u-int8
             * @description Which, 1 to 6 from the base.
             */
            joint: number;
            /**
             * Format: double
             * @description Where the model has it, rad.
             */
            position_rad: number;
        };
        /** @description The joints that are not there. */
        AbsentObject: {
            /** @description Each at most once; empty: all joints are there. */
            absent: components["schemas"]["AbsentJoint"][];
        };
        /** @description The arm that the controller has in use. */
        ArmObject: {
            /** @description Hash of all that decides how the arm moves. */
            hash: string;
            /** @description Its name. */
            name: string;
            /** @description As an arm file, TOML: what `jtc arm pull` writes. */
            text: string;
        };
        /** @description An arm for the controller. */
        ArmRequest: {
            /** @description Keep it over a loss of power: the arm has no torque then, and the controller is in Init behind it. */
            store?: boolean;
            /** @description The text of an arm file (TOML), or of a robot description (URDF) in which nothing but the arm moves. */
            text: string;
        };
        /** @description Which limit a motion uses up, from when to when. */
        BoundObject: {
            /**
             * Format: double
             * @description s from the start.
             */
            from_s: number;
            /**
             * Format: u-int8
             * @description Which joint, 1 to 6 from the base.
             */
            joint: number;
            /** @description `velocity`, `acceleration`, `jerk`, `torque`, `stop` (room to stop in time), `friction` (its table) or `given time`. */
            limit: string;
            /**
             * Format: double
             * @description s from the start.
             */
            to_s: number;
        };
        /** @description What a check found. */
        CheckObject: {
            /** @description What was checked, in short: the digest of the trajectory. */
            digest: string;
            /**
             * Format: double
             * @description s.
             */
            duration_s: number;
            margin?: components["schemas"]["MarginObject"] | null;
            /** @description Nothing forbids to run it from its first point. */
            passed: boolean;
            /** @description What is wrong, worst first. */
            problems: components["schemas"]["ProblemObject"][];
        };
        /** @description Nodes whose errors are cleared. */
        ClearRequest: {
            /** @description The gripper. */
            gripper?: boolean;
            /** @description Joints, 1 to 6 from the base. */
            joints?: number[];
        };
        /** @description What the controller reports. */
        ControllerObject: {
            /**
             * @description What is wrong, the most particular first, with the joint of each: also what its drive reports. `GET /api/explain/{code}` takes them as
             *     they are.
             */
            causes: string[];
            /**
             * @description Where the joints are commanded to be, rad, from the base; missing where the agent does not know: no trajectory that was sent through
             *     it is executed.
             */
            commanded_rad?: number[] | null;
            /** @description Joints from 1 whose encoder had jumped at the last held stop: no trajectory is executed until their drives were reset; missing: none. */
            encoder_jumped?: number[];
            /** @description Names of their pages, in the same order: `GET /api/explain/{code}`. */
            error_codes: string[];
            /** @description Errors now. */
            errors: string[];
            /** @description Errors since they were cleared last. */
            errors_occurred: string[];
            held_stop?: components["schemas"]["HeldStopObject"] | null;
            /** @description Joints, from the base. */
            joints: components["schemas"]["JointObject"][];
            /** @description What helps now; empty where nothing is wrong. */
            next: string;
            /**
             * Format: u-int32
             * @description The 1 ms point of the trajectory that the controller is at.
             */
            point: number;
            /** @description State, in the words of the protocol. */
            state: string;
            /** @description What becomes of the trajectory. */
            trajectory: string;
        };
        /** @description What was found. */
        DoctorObject: {
            /** @description Worst first. */
            findings: components["schemas"]["FindingObject"][];
            /** @description Nothing is a problem. */
            healthy: boolean;
            /**
             * Format: double
             * @description How long was listened, s.
             */
            listened_s: number;
            /**
             * Format: u-int64
             * @description Statuses that came meanwhile.
             */
            statuses: number;
        };
        /** @description Why something was not done. */
        ErrorObject: {
            /**
             * Format: u-int8
             * @description Board of a chain.
             */
            board?: number | null;
            /** @description Usual cause. */
            cause?: string | null;
            /** @description Short name, for programs. */
            code: string;
            /**
             * Format: u-int8
             * @description Joint of an arm, 1 to 6 from the base.
             */
            joint?: number | null;
            /**
             * Format: double
             * @description Limit of the value.
             */
            limit?: number | null;
            /** @description Sentence for people: request, place, value and limit. */
            message: string;
            /** @description Next step. */
            next: string;
            /**
             * Format: u-int32
             * @description Point of the trajectory, from 0; in motion the 1 ms point.
             */
            point?: number | null;
            /**
             * Format: double
             * @description Value that was found, in the unit of the message.
             */
            value?: number | null;
        };
        /** @description An event. */
        EventObject: {
            /** @description What has happened. */
            event: components["schemas"]["Happening"];
            /**
             * Format: u-int64
             * @description Counts up from 1 as long as this agent runs.
             */
            number: number;
            /**
             * Format: double
             * @description When, s since 1970 by the agent's clock.
             */
            unix_s: number;
        };
        /** @description Events. */
        EventsObject: {
            /** @description Which agent this is, by a number that it was given at its start: another one counts its events anew. */
            agent: string;
            /** @description Oldest first. */
            events: components["schemas"]["EventObject"][];
            /**
             * Format: u-int64
             * @description The number to ask on from.
             */
            last: number;
            /** @description Some that were asked for are not kept any more. */
            missed: boolean;
        };
        /** @description A finding. */
        FindingObject: {
            /** @description What helps; empty where nothing is to be done. */
            next: string;
            /** @description `problem`, `warning` or `good`. */
            severity: string;
            /** @description What it is. */
            what: string;
            /** @description What usually causes it; empty where nothing is known. */
            why: string;
        };
        /** @description A pose of the flange in the frame of the base. */
        FlangeObject: {
            /** @description Roll, pitch, yaw about the fixed axes x, y, z, as in a URDF, rad. */
            rpy_rad: number[];
            /** @description x, y, z, m. */
            xyz_m: number[];
        };
        /** @description Where a frame is. */
        FrameObject: {
            /** @description Roll, pitch, yaw, rad. */
            origin_rpy_rad: number[];
            /** @description x, y, z, m. */
            origin_xyz_m: number[];
        };
        /** @description What the controller was given. */
        GivenObject: {
            /** @description Hash of the arm, where all of it was read back and nothing differs. */
            hash?: string | null;
            /** @description The controller has the arm's name. */
            named: boolean;
            /** @description Friction, gains and model, as far as they were confirmed. */
            parts: components["schemas"]["PartObject"][];
            /** @description So many settings have changed. */
            settings: number;
            /**
             * Format: u-int32
             * @description Its number in the memory that lasts.
             */
            stored_number?: number | null;
        };
        /** @description What has happened. */
        Happening: {
            /** @description Its name; missing: nobody commands. */
            holder?: string | null;
            /** @enum {string} */
            kind: "lease";
        } | {
            /** @description Who it was. */
            by: string;
            /** @description `stop` or `pause`. */
            command: string;
            /** @enum {string} */
            kind: "halt";
        } | {
            /** @description Errors now. */
            errors: string[];
            /** @enum {string} */
            kind: "state";
            /** @description State, in the words of the protocol. */
            state: string;
            /** @description What becomes of the trajectory. */
            trajectory: string;
        } | {
            /** @enum {string} */
            kind: "lost";
            /** @description Why. */
            why: string;
        } | {
            /** @description Who asked for it. */
            client: string;
            /**
             * Format: u-int64
             * @description Its number.
             */
            job: number;
            /** @enum {string} */
            kind: "begun";
            /** @description What it does. */
            what: string;
        } | {
            /**
             * Format: u-int64
             * @description Its number.
             */
            job: number;
            /** @enum {string} */
            kind: "note";
            /** @description In words. */
            text: string;
        } | {
            /**
             * Format: double
             * @description s.
             */
            duration_s: number;
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "checked";
            /** @description `approach` or `motion`. */
            phase: string;
            /** @description Points. */
            points: number;
            /** @description What does not forbid to run it. */
            warnings: string[];
        } | {
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "uploading";
            /** @description `approach` or `motion`. */
            phase: string;
            /** @description Of so many. */
            segments: number;
            /** @description Segments that the controller has. */
            segments_done: number;
        } | {
            /** @description Bytes on the line. */
            bytes: number;
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "uploaded";
            /** @description `approach` or `motion`. */
            phase: string;
            /**
             * Format: u-int32
             * @description Segments that were sent again.
             */
            retries: number;
            /**
             * Format: double
             * @description How long that took, s.
             */
            time_s: number;
        } | {
            /** @description Bytes of its frame. */
            bytes: number;
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "given";
            /** @description Which part. */
            parameter: string;
            /**
             * Format: double
             * @description How long that took, s.
             */
            time_s: number;
        } | {
            /**
             * Format: double
             * @description s, at full speed.
             */
            duration_s: number;
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "executing";
            /** @description `approach` or `motion`. */
            phase: string;
        } | {
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "moving";
            /** @description `approach` or `motion`. */
            phase: string;
            /**
             * Format: u-int32
             * @description The 1 ms point that the controller is at.
             */
            point: number;
        } | {
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "finished";
            /**
             * Format: u-int32
             * @description How many motions of this job were finished, approaches not counted.
             */
            runs: number;
        } | {
            error?: components["schemas"]["ErrorObject"] | null;
            /**
             * Format: u-int64
             * @description Its number.
             */
            job: number;
            /** @enum {string} */
            kind: "ended";
            /** @description `finished`, `stopped` or `failed`. */
            outcome: string;
        };
        /** @description A held stop: the controller has brought the arm to rest and holds it. */
        HeldStopObject: {
            /** @description Name of its page: `GET /api/explain/{code}`. */
            code: string;
            /**
             * Format: u-int8
             * @description Joint from 1 that the cause was found at first; missing: at none in particular.
             */
            joint?: number | null;
            /**
             * @description Kind of the cause: `overload`, `push`, `position-error`, `position-over-limit`, `velocity-over-limit`, `acceleration-over-limit`,
             *     `friction-table-value-missing`, `unstable`, `encoder-jump`, `speed-scale`, `approach`, `gains`, `shove`; later versions may have others.
             */
            kind: string;
            /**
             * Format: float
             * @description Limit of the value; missing where there is none.
             */
            limit?: number | null;
            /**
             * Format: u-int8
             * @description Number of the kind, as Modbus has it.
             */
            number: number;
            /** @description What removes the cause, in words. */
            remedy: string;
            /**
             * Format: double
             * @description Time since the held stop began, s.
             */
            since_s: number;
            /** @description Cause in words. */
            text: string;
            /** @description Unit of value and limit; empty where they have none. */
            unit: string;
            /**
             * Format: float
             * @description Value that was found; missing where the kind has none.
             */
            value?: number | null;
        };
        /** @description Who the controller is. */
        InfoObject: {
            /** @description Name of the arm in use. */
            arm: string;
            /** @description The board. */
            board: string;
            /** @description Why it started last. */
            boot_cause: string;
            /**
             * Format: u-int32
             * @description How often it has started.
             */
            boots: number;
            /** @description Its defaults are those of an arm that is stored in it, not those of the built-in arm. */
            defaults_stored: boolean;
            /**
             * Format: u-int8
             * @description Version of the extensions of its protocol; 0: it has none, and nothing else is known.
             */
            extension: number;
            /** @description Version of the firmware. */
            firmware: string;
            /** @description Hash of all that decides how the arm moves. */
            hash: string;
            /**
             * Format: u-int32
             * @description Records lost because too many waited.
             */
            lost_records: number;
            /** @description Parameters that it has not been given. */
            missing: string[];
            reactions?: components["schemas"]["ReactionsObject"] | null;
            /** @description Its git revision. */
            revision: string;
            /**
             * Format: double
             * @description Since then, s.
             */
            uptime_s: number;
        };
        /** @description A job: something that takes its time. */
        JobObject: {
            /** @description Who asked for it. */
            client: string;
            error?: components["schemas"]["ErrorObject"] | null;
            given?: components["schemas"]["GivenObject"] | null;
            /**
             * Format: u-int64
             * @description Its number.
             */
            number: number;
            /** @description Where the report of its last motion is, a page; missing where it has moved nothing, or later ones have taken its place. */
            report?: string | null;
            result?: components["schemas"]["ResultObject"] | null;
            /**
             * Format: u-int32
             * @description Motions that were finished, approaches not counted.
             */
            runs: number;
            /** @description `running`, `finished`, `stopped` or `failed`. */
            stage: string;
            /** @description What it does. */
            what: string;
        };
        /** @description Rates of the joints. */
        JogRequest: {
            /** @description rad/s, base to wrist. They hold for 200 ms: send them again in time, and zeros at the end. */
            rates_rad_s: number[];
        };
        /** @description What the controller reports of a joint. */
        JointObject: {
            /** @description Names of their pages, in the same order. */
            error_codes: string[];
            /** @description Errors that the controller has found at it. */
            errors: string[];
            /**
             * Format: u-int8
             * @description 1 to 6, from the base.
             */
            joint: number;
            /**
             * Format: float
             * @description rad; missing where it is not known.
             */
            position_rad?: number | null;
            /** @description State of its drive. */
            state: string;
            /**
             * Format: u-int8
             * @description °C; missing alike.
             */
            temperature_c?: number | null;
            /**
             * Format: float
             * @description N·m; missing alike.
             */
            torque_nm?: number | null;
            /**
             * Format: float
             * @description rad/s; missing alike.
             */
            velocity_rad_s?: number | null;
        };
        /** @description Figures of a joint. */
        JointPlan: {
            /**
             * Format: double
             * @description Largest absolute acceleration, rad/s².
             */
            acceleration_peak_rad_s2: number;
            /**
             * Format: u-int8
             * @description Which, 1 to 6 from the base.
             */
            joint: number;
            /**
             * Format: double
             * @description Highest position, rad.
             */
            position_max_rad: number;
            /**
             * Format: double
             * @description Lowest position, rad.
             */
            position_min_rad: number;
            /**
             * Format: double
             * @description Largest absolute torque by the model, N·m.
             */
            torque_peak_nm?: number | null;
            /**
             * Format: double
             * @description Largest absolute speed, rad/s.
             */
            velocity_peak_rad_s: number;
        };
        /** @description Figures of a joint. */
        JointResult: {
            /**
             * Format: double
             * @description Largest absolute error, mrad.
             */
            max_error_mrad?: number | null;
            /** @description As in the arm file. */
            name: string;
            /**
             * Format: double
             * @description Largest absolute torque, N·m.
             */
            peak_torque_nm?: number | null;
            /**
             * Format: double
             * @description Largest absolute speed, rad/s.
             */
            peak_velocity_rad_s?: number | null;
            /**
             * Format: double
             * @description Root mean square of the position error, mrad.
             */
            rms_error_mrad?: number | null;
            /**
             * Format: double
             * @description The limit, N·m.
             */
            torque_limit_nm?: number | null;
        };
        /** @description Where a plan is kept. */
        KeepRequest: {
            /** @description What people are to call it: the first 64 characters. */
            name: string;
            /** @description In place of nothing: where the number has a trajectory already the plan is refused, and nothing is replaced. */
            new?: boolean;
            /**
             * Format: u-int16
             * @description Its number, in place of what has it.
             */
            number: number;
        };
        /** @description A client that may command, or waits for it. */
        LeaseGrant: {
            /** @description It commands; else it waits until the one who does lets it go. */
            held: boolean;
            /** @description Goes with each request of this client, in the header `Lease-Key`. Nobody else is to know it. */
            key: string;
            /**
             * Format: double
             * @description How long it lasts without a request, s.
             */
            lasts_s: number;
            /** @description What becomes of a motion when it has lapsed. */
            policy: components["schemas"]["Policy"];
        };
        /** @description Who commands. */
        LeaseObject: {
            /**
             * Format: u-int64
             * @description For how long, ms.
             */
            age_ms: number;
            /** @description Its name. */
            holder: string;
            /**
             * Format: u-int64
             * @description How long it lasts without renewal, ms; missing: as long as the client is connected.
             */
            left_ms?: number | null;
            /** @description Who has asked for it. */
            wanted_by?: string | null;
        };
        /** @description Who wants to command. */
        LeaseRequest: {
            /** @description Where another client commands: ask it for the lease, and wait for it. One waits at a time, which shows by PUT that it is there. */
            ask?: boolean;
            /**
             * Format: double
             * @description How long the lease lasts without a request of this client, s.
             */
            lasts_s?: number;
            /** @description What people are to call it: the first 64 characters. */
            name: string;
            /** @description What becomes of a motion when it has lapsed. */
            policy?: components["schemas"]["Policy"];
        };
        /** @description How a lease is. */
        LeaseState: {
            /** @description This client commands. */
            held: boolean;
            /** @description Who asks for the lease. */
            wanted_by?: string | null;
        };
        /**
         * Format: binary
         * @description A recording in MCAP with the log in it, as `jtc log fetch` writes it.
         */
        LogFile: string;
        /** @description A joint in the log. */
        LogJoint: {
            /** @description Commanded, rad. */
            commanded_rad: (number | null)[];
            /** @description Commanded minus measured, of the same time, rad. */
            error_rad: (number | null)[];
            /** @description Measured, rad. */
            position_rad: (number | null)[];
            /** @description Commanded on the bus, N·m. */
            torque_nm: (number | null)[];
            /** @description Measured, rad/s. */
            velocity_rad_s: (number | null)[];
        };
        /** @description What the flight recorder does. */
        LogStatusObject: {
            /**
             * Format: u-int32
             * @description Blocks of 1 KiB that it has begun since the start of the controller, those counted that are gone.
             */
            blocks: number;
            /** @description In words: it records, or why it has stopped. */
            state: string;
        };
        /** @description What the log holds, tick by tick: 1000 rows a second, in columns of the same length. A value that is not known is null. */
        LogValues: {
            /** @description Base to wrist. */
            joints: components["schemas"]["LogJoint"][];
            /** @description State of the controller in the last row. */
            state: string;
            /** @description Time of each row, s, 0 at the last one. */
            times_s: number[];
        };
        /** @description The smallest share of a torque limit that a motion leaves unused, and where. */
        MarginObject: {
            /**
             * Format: u-int8
             * @description Joint that has the least left, 1 to 6 from the base.
             */
            joint: number;
            /**
             * Format: double
             * @description Torque limit, N·m.
             */
            limit_nm: number;
            /**
             * Format: double
             * @description What is left, % of the limit.
             */
            percent: number;
            /**
             * Format: double
             * @description Bearing temperature of its friction, °C.
             */
            temperature_c: number;
            /**
             * Format: double
             * @description When, s from the start.
             */
            time_s: number;
            /**
             * Format: double
             * @description Torque by the model there, N·m.
             */
            torque_nm: number;
        };
        /** @description A joint: where it is, and its limits. */
        ModelJoint: {
            /**
             * Format: double
             * @description Highest acceleration, rad/s².
             */
            acceleration_max_rad_s2: number;
            /**
             * Format: u-int8
             * @description Which, 1 to 6 from the base.
             */
            joint: number;
            /** @description Its name. */
            name: string;
            /** @description How it is turned there: roll, pitch, yaw about fixed axes, as in a URDF, rad. */
            origin_rpy_rad: number[];
            /** @description Where its frame is in that of the joint before it, at position 0: x, y, z, m. */
            origin_xyz_m: number[];
            /**
             * Format: double
             * @description Highest position, rad.
             */
            position_max_rad: number;
            /**
             * Format: double
             * @description Lowest position, rad.
             */
            position_min_rad: number;
            /**
             * Format: double
             * @description Highest torque, N·m.
             */
            torque_max_nm: number;
            /**
             * Format: double
             * @description Highest speed, rad/s.
             */
            velocity_max_rad_s: number;
        };
        /** @description A link. */
        ModelLink: {
            /** @description Centre of mass, m. */
            com_xyz_m: number[];
            /**
             * Format: double
             * @description kg.
             */
            mass_kg: number;
            /** @description Its name. */
            name: string;
        };
        /** @description The arm in use. */
        ModelObject: {
            /** @description The flange, which does not move, in the frame of joint 6. */
            flange: components["schemas"]["FrameObject"];
            /** @description Acceleration of gravity in the frame of the base, m/s². */
            gravity_m_s2: number[];
            /** @description Hash of all that decides how the arm moves; missing where the agent's arm lacks a part of that. */
            hash?: string | null;
            /** @description Joints, from the base. Each rotates about the z axis of its frame. */
            joints: components["schemas"]["ModelJoint"][];
            /** @description Links: the base, and behind each joint the one that it moves, in whose frame its numbers are. */
            links: components["schemas"]["ModelLink"][];
            /** @description Its name. */
            name: string;
            /** @description Whose it is. */
            source: components["schemas"]["ModelSource"];
        };
        /**
         * @description Whose arm it is.
         * @enum {string}
         */
        ModelSource: "controller" | "agent";
        /** @description A move from where the arm stands, to one of the three places. */
        MoveRequest: {
            /** @description The controller cannot be asked for its limits, and those that are built into it are safe for this arm. */
            accept_device_limits?: boolean;
            /** @description The flange keeps to a straight line. */
            line?: boolean;
            /**
             * Format: double
             * @description Torque to leave for masses and friction that the model does not know, % of each limit.
             */
            margin_percent?: number;
            policy?: components["schemas"]["Policy"] | null;
            /**
             * Format: double
             * @description % of what the limits allow; missing: 10, and 25 where the controller is a simulator.
             */
            speed_percent?: number | null;
            to_flange?: components["schemas"]["FlangeObject"] | null;
            /** @description A named pose, of those that `GET /api/poses` lists. */
            to_pose?: string | null;
            /** @description Joint positions, rad, base to wrist. */
            to_rad?: number[] | null;
        };
        /** @description A page about a code. */
        PageObject: {
            /** @description Other pages that fit what was asked for. */
            also?: string[];
            /** @description Name of the code, unique: as in `error_codes` of the status. */
            code: string;
            /** @description What it means, what usually causes it, what to do, the next command: as `jtc explain` prints it. */
            text: string;
            /** @description As it stands on a screen. */
            title: string;
        };
        /** @description A part that the controller confirmed. */
        PartObject: {
            /** @description Bytes of its frame. */
            bytes: number;
            /** @description Which. */
            parameter: string;
            /**
             * Format: double
             * @description s.
             */
            time_s: number;
            /**
             * Format: u-int32
             * @description How often it was sent on purpose: a friction table twice.
             */
            times: number;
        };
        /** @description What an arm carries at its flange. */
        PayloadObject: {
            /** @description Centre of mass in the frame of the flange, m. */
            com_m: number[];
            /** @description Inertia about the centre of mass, kg·m²: xx, xy, xz, yy, yz, zz. Zeros: a point mass. */
            inertia_kg_m2?: number[];
            /**
             * Format: double
             * @description kg; 0: nothing.
             */
            mass_kg: number;
        };
        /** @description A motion that passed the check. */
        PlanObject: {
            /** @description What binds when, in the order of time. */
            binding: components["schemas"]["BoundObject"][];
            /**
             * Format: double
             * @description s.
             */
            duration_s: number;
            /** @description Figures of each joint, from the base. */
            joints: components["schemas"]["JointPlan"][];
            kept?: components["schemas"]["TrajectoryObject"] | null;
            margin?: components["schemas"]["MarginObject"] | null;
            /** @description What was changed or is to be known, in words. */
            notes: string[];
            /** @description Points. */
            points: number;
            /**
             * Format: u-int16
             * @description ms between two points.
             */
            step_ms: number;
            /** @description The trajectory as a file, for `PUT /api/trajectories/{number}` and `jtc traj run`. */
            text: string;
            /** @description What does not forbid to run it; a torque margin below 10 % is among it. */
            warnings: string[];
            /** @description When the motion is nearest to each waypoint, s. */
            waypoint_times_s: number[];
            /** @description Waypoints. */
            waypoints: number;
        };
        /** @description Waypoints, and how the arm is to go through them. */
        PlanRequest: {
            /**
             * Format: double
             * @description How far from a waypoint the corner between two lines or arcs may be rounded, m; 0: the arm stops there.
             */
            blend_m?: number;
            /**
             * Format: double
             * @description How far from a waypoint its corner may be rounded, rad of the joint that is furthest; 0: the arm stops at each.
             */
            blend_rad?: number;
            /** @description Their numbers are degrees. */
            degrees?: boolean;
            keep?: components["schemas"]["KeepRequest"] | null;
            /** @description The flange keeps to a straight line on each leg of which the waypoints do not say how the arm moves. */
            line?: boolean;
            /**
             * Format: double
             * @description Torque to leave for masses and friction that the model does not know, % of each limit.
             */
            margin_percent?: number;
            /** @description Let the acceleration change within 20 ms instead of 100 ms: faster, and harder on gears and load. */
            no_jerk_limit?: boolean;
            payload?: components["schemas"]["PayloadObject"] | null;
            /**
             * Format: double
             * @description % of what the limits allow.
             */
            speed_percent?: number;
            /**
             * Format: double
             * @description Lowest bearing temperature at which it will be run, °C: cold bearings take more torque.
             */
            temperature_c?: number;
            /** @description Waypoints in a form that `jtc plan` takes: CSV with the columns q1 to q6, or x, y, z with an orientation, or pose; or JSON. At most 500. */
            waypoints: string;
        };
        /** @description A trajectory to draw. */
        PointsObject: {
            /** @description What is executed of it, in short, 16 hexadecimal digits: it is another one for other points or another step. `POST /api/runs` takes it. */
            digest: string;
            /**
             * Format: double
             * @description s.
             */
            duration_s: number;
            /** @description What people call it. */
            name: string;
            /**
             * Format: u-int16
             * @description Its number.
             */
            number: number;
            /** @description Where the joints are at each of them, from the base, rad. */
            positions_rad: number[][];
            /** @description Times of the points, s. */
            times_s: number[];
        };
        /**
         * @description What becomes of a motion when the client that commanded it goes, or shows no more that it is there.
         * @enum {string}
         */
        Policy: "continue" | "pause" | "stop";
        /**
         * @description Where a pose is kept.
         * @enum {string}
         */
        PoseFrom: "arm file" | "agent";
        /** @description A named pose. */
        PoseObject: {
            /** @description Where it is kept. */
            from: components["schemas"]["PoseFrom"];
            /** @description Its name. */
            name: string;
            /** @description Where the joints are, from the base, rad. */
            positions_rad: number[];
            /** @description Why no motion leads there, in words; missing where one may. */
            warning?: string | null;
        };
        /** @description Where a pose is. */
        PoseRequest: {
            /** @description rad, from the base; missing: where the arm stands now. */
            positions_rad?: number[] | null;
        };
        /** @description A thing that is wrong with a trajectory. */
        ProblemObject: {
            /**
             * Format: u-int8
             * @description Which joint; missing: the trajectory as a whole.
             */
            joint?: number | null;
            /**
             * Format: double
             * @description Its limit.
             */
            limit?: number | null;
            /** @description In words, with value, limit and place. */
            message: string;
            /** @description Point, from 0, where it is worst. */
            point: number;
            /**
             * Format: double
             * @description Time along the path, s.
             */
            time_s: number;
            /**
             * Format: double
             * @description Worst value; missing where it is no number.
             */
            value?: number | null;
            /** @description It does not forbid to run the trajectory. */
            warning: boolean;
        };
        /** @description What a controller does about what it has found. */
        ReactionsObject: {
            /** @description Joints from 1 whose encoder has jumped: no trajectory is executed until their drives were reset. */
            encoder_jumped: number[];
            /**
             * Format: double
             * @description Time for which this run has been held back because a torque was at its limit, s.
             */
            held_back_s: number;
            last_held_stop?: components["schemas"]["HeldStopObject"] | null;
            /**
             * Format: float
             * @description Rate of path time, path seconds per second; 0 where no trajectory is executed.
             */
            path_rate: number;
            /** @description Joints from 1 that yield to a push, or lower a load. */
            yields: number[];
        };
        /** @description The way back to a held arm. */
        RecoverRequest: {
            /** @description The controller uses other limits than this arm has, and they are safe for it. */
            accept_device_limits?: boolean;
            /** @description The text of an arm file, or of a robot description: the controller is given its friction, gains and model. Not beside `defaults`. */
            arm?: string | null;
            /** @description Where the controller has not been given its arm: let it use its defaults, the stored arm where there is one. */
            defaults?: boolean;
        };
        /** @description A page that opens in a browser, and needs nothing else. */
        ReportPage: string;
        /** @description Nodes that start anew. */
        ResetRequest: {
            /** @description All joints and the gripper. */
            all?: boolean;
            /** @description Also where the arm has torque: somebody supports it, or it may fall. */
            arm_may_fall?: boolean;
            /** @description The gripper. */
            gripper?: boolean;
            /** @description Joints, 1 to 6 from the base. */
            joints?: number[];
        };
        /** @description Figures of a motion. */
        ResultObject: {
            /**
             * Format: double
             * @description While the trajectory was executed, s.
             */
            executed_s: number;
            /** @description Joints, from the base. */
            joints: components["schemas"]["JointResult"][];
        };
        /**
         * @description What a client may do.
         * @enum {string}
         */
        Role: "viewer" | "operator";
        /** @description A run of a trajectory that is kept. */
        RunRequest: {
            /** @description The controller cannot be asked for its limits, and those that are built into it are safe for this arm. */
            accept_device_limits?: boolean;
            /**
             * @description Where the arm stands elsewhere it is moved to the first point, at `speed_percent` of the limits and at half of them at most. Without
             *     `speed_percent` at 10 % of the limits, and at 25 % where the controller is a simulator.
             */
            approach?: boolean;
            /** @description Digest of the trajectory that was looked at: where the number has another one by now nothing is sent. */
            digest?: string | null;
            policy?: components["schemas"]["Policy"] | null;
            /**
             * Format: u-int32
             * @description How often it is run.
             */
            repeat?: number;
            /**
             * Format: double
             * @description % of the trajectory's own speed; missing: 100.
             */
            speed_percent?: number | null;
            /**
             * Format: u-int16
             * @description Its number.
             */
            trajectory: number;
        };
        /** @description A command that was handed to the line. */
        SentObject: {
            /**
             * Format: u-int64
             * @description Its number: `last_halt` until the next.
             */
            halt: number;
            /** @description What was sent: `stop` or `pause`. */
            sent: string;
        };
        /** @description A setting that is to have another value. */
        SettingChange: {
            /**
             * Format: u-int8
             * @description Which joint, from the base; missing for a setting of the arm.
             */
            joint?: number | null;
            /** @description Its name, with its unit. */
            name: string;
            /**
             * Format: double
             * @description The value; switches are 0 or 1.
             */
            value: number;
        };
        /** @description A setting as the controller has it. */
        SettingObject: {
            /**
             * Format: double
             * @description Highest value.
             */
            high: number;
            /**
             * Format: u-int8
             * @description Which joint, 1 to 6 from the base; missing: it is one of the arm.
             */
            joint?: number | null;
            /**
             * Format: double
             * @description Lowest value.
             */
            low: number;
            /** @description What it is. */
            meaning: string;
            /** @description Its name, with its unit. */
            name: string;
            /** @description It is stored with the arm, and in its hash. */
            of_arm: boolean;
            /** @description Its unit; empty where it has none. */
            unit: string;
            /**
             * Format: double
             * @description The value; switches are 0 or 1.
             */
            value: number;
            /** @description When it may be changed. */
            when: components["schemas"]["When"];
            /** @description Whole numbers only. */
            whole: boolean;
        };
        /** @description Settings that are to have other values: all of them, or none. */
        SettingsRequest: {
            /** @description Each at most once. */
            settings: components["schemas"]["SettingChange"][];
        };
        /** @description % of the speed of the trajectory. */
        SpeedObject: {
            /**
             * Format: u-int8
             * @description 5 to 100.
             */
            percent: number;
        };
        /** @description The controller, as its last status has it. */
        StatusObject: {
            /**
             * Format: u-int64
             * @description Time since the last status, ms; missing before the first. Old values are not those of now.
             */
            age_ms?: number | null;
            /** @description Which agent this is, by a number that it was given at its start. */
            agent: string;
            /**
             * Format: u-int64
             * @description Time of this agent when this was made: since it began, ms. Who reads that it is long ago receives late, however steadily.
             */
            at_ms: number;
            /** @description How many clients are on the line. */
            clients: number;
            controller?: components["schemas"]["ControllerObject"] | null;
            /**
             * Format: u-int64
             * @description Number of the last event.
             */
            last_event: number;
            /**
             * Format: u-int64
             * @description Number of the last Stop or Pause: `asked_after` of what is asked for now.
             */
            last_halt: number;
            lease?: components["schemas"]["LeaseObject"] | null;
            /** @description Why the port is gone; missing while it is there. */
            lost?: string | null;
            /** @description Name of the port. */
            port: string;
            /** @description What the caller may do. */
            role: components["schemas"]["Role"];
            /** @description No arm moves: the controller is simulated. */
            simulated: boolean;
        };
        /** @description On or off. */
        Switch: {
            /** @description True: on. */
            on: boolean;
        };
        /** @description A trajectory that is kept. */
        TrajectoryObject: {
            /** @description What is executed of it, in short, 16 hexadecimal digits: it is another one for other points or another step. `POST /api/runs` takes it. */
            digest: string;
            /**
             * Format: double
             * @description s.
             */
            duration_s: number;
            /** @description What people call it. */
            name: string;
            /** @description What was derived or left out when it was read. */
            notes: string[];
            /**
             * Format: u-int16
             * @description Its number.
             */
            number: number;
            /** @description Points. */
            points: number;
            /**
             * Format: u-int16
             * @description ms between two points.
             */
            step_ms: number;
        };
        /** @description A trajectory to keep. */
        TrajectoryRequest: {
            /** @description Its numbers are degrees. */
            degrees?: boolean;
            /** @description What people are to call it: the first 64 characters. */
            name: string;
            /** @description A file's text in any form that jtc traj run takes but recordings: CSV with a time column and joints, JSON, or a ROS JointTrajectory. */
            text: string;
        };
        /**
         * @description When a setting may be changed.
         * @enum {string}
         */
        When: "unpowered" | "standing" | "always";
    };
    responses: never;
    parameters: never;
    requestBodies: never;
    headers: never;
    pathItems: never;
}
export type AbsentJoint = components['schemas']['AbsentJoint'];
export type AbsentObject = components['schemas']['AbsentObject'];
export type ArmObject = components['schemas']['ArmObject'];
export type ArmRequest = components['schemas']['ArmRequest'];
export type BoundObject = components['schemas']['BoundObject'];
export type CheckObject = components['schemas']['CheckObject'];
export type ClearRequest = components['schemas']['ClearRequest'];
export type ControllerObject = components['schemas']['ControllerObject'];
export type DoctorObject = components['schemas']['DoctorObject'];
export type ErrorObject = components['schemas']['ErrorObject'];
export type EventObject = components['schemas']['EventObject'];
export type EventsObject = components['schemas']['EventsObject'];
export type FindingObject = components['schemas']['FindingObject'];
export type FlangeObject = components['schemas']['FlangeObject'];
export type FrameObject = components['schemas']['FrameObject'];
export type GivenObject = components['schemas']['GivenObject'];
export type Happening = components['schemas']['Happening'];
export type HeldStopObject = components['schemas']['HeldStopObject'];
export type InfoObject = components['schemas']['InfoObject'];
export type JobObject = components['schemas']['JobObject'];
export type JogRequest = components['schemas']['JogRequest'];
export type JointObject = components['schemas']['JointObject'];
export type JointPlan = components['schemas']['JointPlan'];
export type JointResult = components['schemas']['JointResult'];
export type KeepRequest = components['schemas']['KeepRequest'];
export type LeaseGrant = components['schemas']['LeaseGrant'];
export type LeaseObject = components['schemas']['LeaseObject'];
export type LeaseRequest = components['schemas']['LeaseRequest'];
export type LeaseState = components['schemas']['LeaseState'];
export type LogFile = components['schemas']['LogFile'];
export type LogJoint = components['schemas']['LogJoint'];
export type LogStatusObject = components['schemas']['LogStatusObject'];
export type LogValues = components['schemas']['LogValues'];
export type MarginObject = components['schemas']['MarginObject'];
export type ModelJoint = components['schemas']['ModelJoint'];
export type ModelLink = components['schemas']['ModelLink'];
export type ModelObject = components['schemas']['ModelObject'];
export type ModelSource = components['schemas']['ModelSource'];
export type MoveRequest = components['schemas']['MoveRequest'];
export type PageObject = components['schemas']['PageObject'];
export type PartObject = components['schemas']['PartObject'];
export type PayloadObject = components['schemas']['PayloadObject'];
export type PlanObject = components['schemas']['PlanObject'];
export type PlanRequest = components['schemas']['PlanRequest'];
export type PointsObject = components['schemas']['PointsObject'];
export type Policy = components['schemas']['Policy'];
export type PoseFrom = components['schemas']['PoseFrom'];
export type PoseObject = components['schemas']['PoseObject'];
export type PoseRequest = components['schemas']['PoseRequest'];
export type ProblemObject = components['schemas']['ProblemObject'];
export type ReactionsObject = components['schemas']['ReactionsObject'];
export type RecoverRequest = components['schemas']['RecoverRequest'];
export type ReportPage = components['schemas']['ReportPage'];
export type ResetRequest = components['schemas']['ResetRequest'];
export type ResultObject = components['schemas']['ResultObject'];
export type Role = components['schemas']['Role'];
export type RunRequest = components['schemas']['RunRequest'];
export type SentObject = components['schemas']['SentObject'];
export type SettingChange = components['schemas']['SettingChange'];
export type SettingObject = components['schemas']['SettingObject'];
export type SettingsRequest = components['schemas']['SettingsRequest'];
export type SpeedObject = components['schemas']['SpeedObject'];
export type StatusObject = components['schemas']['StatusObject'];
export type Switch = components['schemas']['Switch'];
export type TrajectoryObject = components['schemas']['TrajectoryObject'];
export type TrajectoryRequest = components['schemas']['TrajectoryRequest'];
export type When = components['schemas']['When'];
export type $defs = Record<string, never>;
export type operations = Record<string, never>;
