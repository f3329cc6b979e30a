// Made of docs/openapi.json by npm run types.
export type paths = Record<string, never>;
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /** @description Absent joint. */
        AbsentJoint: {
            /**
             * Format: u-int8
             * @description Number of the joint, 1 to 6 from the base.
             */
            joint: number;
            /**
             * Format: double
             * @description Assumed position of the absent joint in the arm model, rad.
             */
            position_rad: number;
        };
        /** @description Joints that are set absent. */
        AbsentObject: {
            /** @description Joints, each at most once; empty: no joint is absent. */
            absent: components["schemas"]["AbsentJoint"][];
        };
        /** @description Event of an arm or a job. */
        ArmEvent: {
            /** @description Name of the holder; missing: no client holds the lease. */
            holder?: string | null;
            /** @enum {string} */
            kind: "lease";
        } | {
            /** @description Name of the client that requested it. */
            by: string;
            /** @description `stop` or `pause`. */
            command: string;
            /** @enum {string} */
            kind: "halt";
        } | {
            /** @description Current errors. */
            errors: string[];
            /** @enum {string} */
            kind: "state";
            /** @description State, as named in the protocol. */
            state: string;
            /** @description State of the trajectory. */
            trajectory: string;
        } | {
            /** @enum {string} */
            kind: "lost";
            /** @description Reason of the loss. */
            why: string;
        } | {
            /** @description Name of the client that requested it. */
            client: string;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "begun";
            /** @description Description of the job. */
            what: string;
        } | {
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "note";
            /** @description Text of the note. */
            text: string;
        } | {
            /**
             * Format: double
             * @description Duration, s.
             */
            duration_s: number;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "checked";
            /** @description `approach` or `motion`. */
            phase: string;
            /** @description Number of points. */
            points: number;
            /** @description Warnings, which do not prevent a run. */
            warnings: string[];
        } | {
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "uploading";
            /** @description `approach` or `motion`. */
            phase: string;
            /** @description Number of segments of the motion. */
            segments: number;
            /** @description Number of segments that the controller has confirmed. */
            segments_done: number;
        } | {
            /** @description Number of bytes of all segments. */
            bytes: number;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "uploaded";
            /** @description `approach` or `motion`. */
            phase: string;
            /**
             * Format: u-int32
             * @description Number of repeated segments.
             */
            retries: number;
            /**
             * Format: double
             * @description Duration of the upload, s.
             */
            time_s: number;
        } | {
            /** @description Length of its frame, bytes. */
            bytes: number;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "given";
            /** @description Name of the parameter. */
            parameter: string;
            /**
             * Format: double
             * @description Duration, s.
             */
            time_s: number;
        } | {
            /**
             * Format: double
             * @description Duration at full speed, s.
             */
            duration_s: number;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "executing";
            /** @description `approach` or `motion`. */
            phase: string;
        } | {
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "moving";
            /** @description `approach` or `motion`. */
            phase: string;
            /**
             * Format: u-int32
             * @description Current 1 ms point of the trajectory.
             */
            point: number;
        } | {
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "finished";
            /**
             * Format: u-int32
             * @description Number of finished motions of this job, without approaches.
             */
            runs: number;
        } | {
            error?: components["schemas"]["ErrorObject"] | null;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "ended";
            /** @description `finished`, `stopped` or `failed`. */
            outcome: string;
        };
        /** @description Arm that the controller uses. */
        ArmObject: {
            /** @description Hash of all parameters that determine how the arm moves. */
            hash: string;
            /** @description Name of the arm. */
            name: string;
            /** @description Arm file in TOML, as `jtc arm pull` writes it. */
            text: string;
        };
        /** @description Arm to send to the controller. */
        ArmRequest: {
            /**
             * @description `true`: store the arm in non-volatile memory. While the controller stores the arm, the arm has no torque.
             *     Afterwards, the controller stays in Init.
             */
            store?: boolean;
            /** @description Text of an arm file (TOML), or of a robot description (URDF) in which only the arm has movable joints. */
            text: string;
        };
        /** @description Limiting constraint of a motion during an interval. */
        BoundObject: {
            /**
             * Format: double
             * @description Start of the interval, s from the start.
             */
            from_s: number;
            /**
             * Format: u-int8
             * @description Number of the joint, 1 to 6 from the base.
             */
            joint: number;
            /**
             * @description Limit: `velocity`, `acceleration`, `jerk`, `torque`, `stop` (distance to stop in time), `friction` (the friction
             *     table) or `given time`.
             */
            limit: string;
            /**
             * Format: double
             * @description End of the interval, s from the start.
             */
            to_s: number;
        };
        /** @description Result of a check. */
        CheckObject: {
            /** @description Digest of the checked trajectory. */
            digest: string;
            /**
             * Format: double
             * @description Duration, s.
             */
            duration_s: number;
            margin?: components["schemas"]["MarginObject"] | null;
            /** @description `true` if the trajectory can run from its first point. */
            passed: boolean;
            /** @description Problems, worst first. */
            problems: components["schemas"]["ProblemObject"][];
        };
        /** @description Nodes whose errors are to be cleared. */
        ClearRequest: {
            /** @description `true` for the gripper. */
            gripper?: boolean;
            /** @description Joints, 1 to 6 from the base. */
            joints?: number[];
        };
        /** @description Status of the controller. */
        ControllerObject: {
            /**
             * @description Causes of the errors, the most specific first, each with its joint. The causes include the errors of the drives.
             *     `GET /api/explain/{code}` accepts these texts.
             */
            causes: string[];
            /**
             * @description Commanded joint positions, rad, from the base. Missing unless the controller executes a trajectory that was sent
             *     through the agent.
             */
            commanded_rad?: number[] | null;
            /**
             * @description Joints with an encoder jump at the last held stop, counted from 1; missing: none. The controller executes no
             *     trajectory until the drives of these joints are reset.
             */
            encoder_jumped?: number[];
            /** @description Codes of the current errors, in the order of `errors`, for `GET /api/explain/{code}`. */
            error_codes: string[];
            /** @description Current errors. */
            errors: string[];
            /** @description Errors that have occurred since the list of occurred errors was last cleared. */
            errors_occurred: string[];
            held_stop?: components["schemas"]["HeldStopObject"] | null;
            /** @description Joints, from the base. */
            joints: components["schemas"]["JointObject"][];
            /** @description Next step; empty without a problem. */
            next: string;
            /**
             * Format: u-int32
             * @description Current 1 ms point of the trajectory.
             */
            point: number;
            /** @description State, as named in the protocol. */
            state: string;
            /** @description State of the trajectory. */
            trajectory: string;
        };
        /** @description Result of a diagnosis. */
        DoctorObject: {
            /** @description Findings, worst first. */
            findings: components["schemas"]["FindingObject"][];
            /** @description `true` if no finding is a problem. */
            healthy: boolean;
            /**
             * Format: double
             * @description Listening time, s.
             */
            listened_s: number;
            /**
             * Format: u-int64
             * @description Number of statuses received during the listening time.
             */
            statuses: number;
        };
        /** @description Reason why a request was refused or failed. */
        ErrorObject: {
            /**
             * Format: u-int8
             * @description Number of a board of a chain.
             */
            board?: number | null;
            /** @description Usual cause. */
            cause?: string | null;
            /** @description Short name of the error, for programs. */
            code: string;
            /**
             * Format: u-int8
             * @description Number of a joint of an arm, 1 to 6 from the base.
             */
            joint?: number | null;
            /**
             * Format: double
             * @description Limit of the value.
             */
            limit?: number | null;
            /**
             * @description Message for people. As far as they apply, it contains the request, the joint, board or point, the value and
             *     the limit.
             */
            message: string;
            /** @description Next step. */
            next: string;
            /**
             * Format: u-int32
             * @description Index of a point of the trajectory, from 0; during a motion, index of the 1 ms point.
             */
            point?: number | null;
            /**
             * Format: double
             * @description Measured or requested value, in the unit of the message.
             */
            value?: number | null;
        };
        /** @description Event with its number and time. */
        EventObject: {
            /** @description Event. */
            event: components["schemas"]["ArmEvent"];
            /**
             * Format: u-int64
             * @description Number of the event; counts up from 1 as long as this agent runs.
             */
            number: number;
            /**
             * Format: double
             * @description Time of the event by the agent's clock, s since 1970.
             */
            unix_s: number;
        };
        /** @description Events. */
        EventsObject: {
            /** @description Number that identifies this run of the agent. Each run counts its events from 1. */
            agent: string;
            /** @description Events, oldest first. */
            events: components["schemas"]["EventObject"][];
            /**
             * Format: u-int64
             * @description Number to use as `after` in the next request.
             */
            last: number;
            /** @description `true` if some requested events were dropped from the journal. */
            missed: boolean;
        };
        /** @description Finding of a diagnosis. */
        FindingObject: {
            /** @description Next step; empty if no action is needed. */
            next: string;
            /** @description Severity: `problem`, `warning` or `good`. */
            severity: string;
            /** @description Text of the finding. */
            what: string;
            /** @description Probable cause; empty if no cause is known. */
            why: string;
        };
        /** @description Pose of the flange in the frame of the base. */
        FlangeObject: {
            /** @description Roll, pitch, yaw about the fixed axes x, y, z, as in a URDF, rad. */
            rpy_rad: number[];
            /** @description Position x, y, z, m. */
            xyz_m: number[];
        };
        /** @description Position and orientation of a frame. */
        FrameObject: {
            /** @description Roll, pitch, yaw, rad. */
            origin_rpy_rad: number[];
            /** @description Origin x, y, z, m. */
            origin_xyz_m: number[];
        };
        /** @description Parameters that were sent to the controller. */
        GivenObject: {
            /** @description Hash of the arm, if all parameters were read back without a difference. */
            hash?: string | null;
            /** @description `true` if the controller has confirmed the name of the arm. */
            named: boolean;
            /** @description Friction, gains and model, as far as the controller confirmed them. */
            parts: components["schemas"]["PartObject"][];
            /** @description Number of settings that have changed. */
            settings: number;
            /**
             * Format: u-int32
             * @description Number of the arm in the non-volatile memory.
             */
            stored_number?: number | null;
        };
        /** @description Held stop: the controller has brought the arm to rest and holds its position. */
        HeldStopObject: {
            /** @description Code of the held stop, for `GET /api/explain/{code}`. */
            code: string;
            /**
             * Format: u-int8
             * @description First joint in which the cause occurred, counted from 1; missing if the cause does not concern a joint.
             */
            joint?: number | null;
            /**
             * @description Kind of the cause: `overload`, `push`, `position-error`, `position-over-limit`, `velocity-over-limit`,
             *     `acceleration-over-limit`, `friction-table-value-missing`, `unstable`, `encoder-jump`, `speed-scale`,
             *     `approach`, `gains`, `shove`; later versions may have others.
             */
            kind: string;
            /**
             * Format: float
             * @description Limit of the value; missing without a limit.
             */
            limit?: number | null;
            /**
             * Format: u-int8
             * @description Number of the kind, as in the Modbus registers.
             */
            number: number;
            /** @description Remedy in words. */
            remedy: string;
            /**
             * Format: double
             * @description Time since the held stop began, s.
             */
            since_s: number;
            /** @description Cause in words. */
            text: string;
            /** @description Unit of value and limit; empty if they have no unit. */
            unit: string;
            /**
             * Format: float
             * @description Value that caused the stop; missing if the kind has no value.
             */
            value?: number | null;
        };
        /** @description Identity of the controller. */
        InfoObject: {
            /** @description Name of the arm in use. */
            arm: string;
            /** @description Board of the controller. */
            board: string;
            /** @description Cause of the last start. */
            boot_cause: string;
            /**
             * Format: u-int32
             * @description Number of starts.
             */
            boots: number;
            /** @description `true` if its defaults are the parameters of a stored arm, not of the built-in arm. */
            defaults_stored: boolean;
            /**
             * Format: u-int8
             * @description Version of the protocol extensions. 0: the controller has no extensions, and all other values are unknown.
             */
            extension: number;
            /** @description Version of the firmware. */
            firmware: string;
            /** @description Hash of all parameters that determine how the arm moves. */
            hash: string;
            /**
             * Format: u-int32
             * @description Number of response records that were lost because too many records waited.
             */
            lost_records: number;
            /** @description Parameters that the controller has not received. */
            missing: string[];
            reactions?: components["schemas"]["ReactionsObject"] | null;
            /** @description Git revision of the firmware. */
            revision: string;
            /**
             * Format: double
             * @description Time since the last start, s.
             */
            uptime_s: number;
        };
        /** @description Job: work of the agent that continues after the answer to its request. */
        JobObject: {
            /** @description Name of the client that requested it. */
            client: string;
            error?: components["schemas"]["ErrorObject"] | null;
            given?: components["schemas"]["GivenObject"] | null;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            number: number;
            /**
             * @description Address of the report page of its last motion. Missing if nothing moved, or if later reports have replaced the
             *     report.
             */
            report?: string | null;
            result?: components["schemas"]["ResultObject"] | null;
            /**
             * Format: u-int32
             * @description Number of finished motions, without approaches.
             */
            runs: number;
            /** @description `running`, `finished`, `stopped` or `failed`. */
            stage: string;
            /** @description Description of the job. */
            what: string;
        };
        /** @description Joint rates of a jog. */
        JogRequest: {
            /** @description Joint rates, rad/s, base to wrist. Rates act for 200 ms: send them again within this time, and send zeros at the end. */
            rates_rad_s: number[];
        };
        /** @description Status of a joint. */
        JointObject: {
            /** @description Codes of the errors of this joint, in the order of `errors`, for `GET /api/explain/{code}`. */
            error_codes: string[];
            /** @description Errors of this joint that the controller has detected. */
            errors: string[];
            /**
             * Format: u-int8
             * @description Number of the joint, 1 to 6 from the base.
             */
            joint: number;
            /**
             * Format: float
             * @description Position, rad; missing if it is not known.
             */
            position_rad?: number | null;
            /** @description State of its drive. */
            state: string;
            /**
             * Format: u-int8
             * @description Temperature, °C; missing if it is not known.
             */
            temperature_c?: number | null;
            /**
             * Format: float
             * @description Torque, N·m; missing if it is not known.
             */
            torque_nm?: number | null;
            /**
             * Format: float
             * @description Velocity, rad/s; missing if it is not known.
             */
            velocity_rad_s?: number | null;
        };
        /** @description Results for a joint. */
        JointPlan: {
            /**
             * Format: double
             * @description Largest absolute acceleration, rad/s².
             */
            acceleration_peak_rad_s2: number;
            /**
             * Format: u-int8
             * @description Number of the joint, 1 to 6 from the base.
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
             * @description Largest absolute torque that the model predicts, N·m.
             */
            torque_peak_nm?: number | null;
            /**
             * Format: double
             * @description Largest absolute speed, rad/s.
             */
            velocity_peak_rad_s: number;
        };
        /** @description Results for a joint. */
        JointResult: {
            /**
             * Format: double
             * @description Largest absolute error, mrad.
             */
            max_error_mrad?: number | null;
            /** @description Name of the joint in the arm file. */
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
             * @description Torque limit, N·m.
             */
            torque_limit_nm?: number | null;
        };
        /** @description Number and name of a planned trajectory. */
        KeepRequest: {
            /** @description Name of the trajectory for users. The agent uses the first 64 characters. */
            name: string;
            /** @description `true`: refuse the plan if the number is taken, and replace nothing. */
            new?: boolean;
            /**
             * Format: u-int16
             * @description Number of the trajectory; it replaces a trajectory with the same number.
             */
            number: number;
        };
        /** @description Client that holds the lease or waits for it. */
        LeaseGrant: {
            /** @description `true` if the client holds the lease; `false` if it waits until the lease holder releases the lease. */
            held: boolean;
            /** @description Secret key, which this client sends with each request in the header `Lease-Key`. */
            key: string;
            /**
             * Format: double
             * @description Time without a request after which the lease lapses, s.
             */
            lasts_s: number;
            /** @description Policy for a motion after the lease has lapsed. */
            policy: components["schemas"]["Policy"];
        };
        /** @description Lease, and its holder. */
        LeaseObject: {
            /**
             * Format: u-int64
             * @description Time since the holder took the lease, ms.
             */
            age_ms: number;
            /** @description Name of the holder. */
            holder: string;
            /**
             * Format: u-int64
             * @description Time until the lease lapses without renewal, ms; missing: the lease lasts while its holder is connected.
             */
            left_ms?: number | null;
            /** @description Name of the client that waits for the lease. */
            wanted_by?: string | null;
        };
        /** @description Request for the lease. */
        LeaseRequest: {
            /**
             * @description `true`: if another client holds the lease, ask that client for the lease, and wait. Only one client can wait at a
             *     time. The waiting client must repeat `PUT /api/lease` within `lasts_s`.
             */
            ask?: boolean;
            /**
             * Format: double
             * @description Time without a request of this client after which the lease lapses, s.
             */
            lasts_s?: number;
            /** @description Name of the client for users. The agent uses the first 64 characters. */
            name: string;
            /** @description Policy for a motion after the lease has lapsed. */
            policy?: components["schemas"]["Policy"];
        };
        /** @description State of a lease. */
        LeaseState: {
            /** @description `true` if this client holds the lease. */
            held: boolean;
            /** @description Name of the client that waits for the lease. */
            wanted_by?: string | null;
        };
        /**
         * Format: binary
         * @description MCAP recording with the log, as `jtc log fetch` writes it.
         */
        LogFile: string;
        /** @description Values of a joint in the log. */
        LogJoint: {
            /** @description Commanded position, rad. */
            commanded_rad: (number | null)[];
            /** @description Commanded minus measured position at the same time, rad. */
            error_rad: (number | null)[];
            /** @description Measured position, rad. */
            position_rad: (number | null)[];
            /** @description Torque commanded on the bus, N·m. */
            torque_nm: (number | null)[];
            /** @description Measured velocity, rad/s. */
            velocity_rad_s: (number | null)[];
        };
        /** @description State of the flight recorder. */
        LogStatusObject: {
            /**
             * Format: u-int32
             * @description Number of blocks of 1 KiB begun since the start of the controller, including overwritten ones.
             */
            blocks: number;
            /** @description State in words: recording, or the reason why the recorder has stopped. */
            state: string;
        };
        /**
         * @description Values of the log in columns of the same length. Each row is one tick of the controller, at 1000 rows per second.
         *     An unknown value is null.
         */
        LogValues: {
            /** @description Joints, base to wrist. */
            joints: components["schemas"]["LogJoint"][];
            /** @description State of the controller in the last row. */
            state: string;
            /** @description Time of each row, s; 0 at the last row. */
            times_s: number[];
        };
        /** @description Smallest torque margin of a motion, with its joint and time. */
        MarginObject: {
            /**
             * Format: u-int8
             * @description Number of the joint with the smallest margin, 1 to 6 from the base.
             */
            joint: number;
            /**
             * Format: double
             * @description Torque limit, N·m.
             */
            limit_nm: number;
            /**
             * Format: double
             * @description Margin: unused part of the torque limit, % of the limit.
             */
            percent: number;
            /**
             * Format: double
             * @description Bearing temperature for which the friction was computed, °C.
             */
            temperature_c: number;
            /**
             * Format: double
             * @description Time of the smallest margin, s from the start.
             */
            time_s: number;
            /**
             * Format: double
             * @description Torque of the model at that time, N·m.
             */
            torque_nm: number;
        };
        /** @description Frame and limits of a joint. */
        ModelJoint: {
            /**
             * Format: double
             * @description Highest acceleration, rad/s².
             */
            acceleration_max_rad_s2: number;
            /**
             * Format: u-int8
             * @description Number of the joint, 1 to 6 from the base.
             */
            joint: number;
            /** @description Name of the joint. */
            name: string;
            /**
             * @description Orientation of its frame at position 0, in the frame of the joint before it: roll, pitch, yaw about fixed axes, as
             *     in a URDF, rad.
             */
            origin_rpy_rad: number[];
            /** @description Origin of its frame at position 0, in the frame of the joint before it: x, y, z, m. */
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
        /** @description Link of the arm. */
        ModelLink: {
            /** @description Centre of mass, m. */
            com_xyz_m: number[];
            /**
             * Format: double
             * @description Mass, kg.
             */
            mass_kg: number;
            /** @description Name of the link. */
            name: string;
        };
        /** @description Arm in use. */
        ModelObject: {
            /** @description Frame of the flange, fixed in the frame of joint 6. */
            flange: components["schemas"]["FrameObject"];
            /** @description Acceleration of gravity in the frame of the base, m/s². */
            gravity_m_s2: number[];
            /** @description Hash of all parameters that determine how the arm moves; missing if the agent's arm lacks one of them. */
            hash?: string | null;
            /** @description Joints, from the base. Each rotates about the z axis of its frame. */
            joints: components["schemas"]["ModelJoint"][];
            /** @description Links: the base, then for each joint the link that it moves. Values are in the frame of that joint. */
            links: components["schemas"]["ModelLink"][];
            /** @description Name of the arm. */
            name: string;
            /** @description Source of the arm. */
            source: components["schemas"]["ModelSource"];
        };
        /**
         * @description Source of an arm model.
         * @enum {string}
         */
        ModelSource: "controller" | "agent";
        /** @description Move from the current position to one of three targets: joint positions, a named pose, or a pose of the flange. */
        MoveRequest: {
            /** @description `true`: accept a controller that cannot report its limits. Its built-in limits must be safe for this arm. */
            accept_device_limits?: boolean;
            /** @description `true`: the flange moves on a straight line. */
            line?: boolean;
            /**
             * Format: double
             * @description Torque margin for masses and friction that the model does not know, % of each limit.
             */
            margin_percent?: number;
            policy?: components["schemas"]["Policy"] | null;
            /**
             * Format: double
             * @description Speed, % of the limits; missing: 10, and 25 with a simulated controller.
             */
            speed_percent?: number | null;
            to_flange?: components["schemas"]["FlangeObject"] | null;
            /** @description Name of a target pose that `GET /api/poses` lists. */
            to_pose?: string | null;
            /** @description Target joint positions, rad, base to wrist. */
            to_rad?: number[] | null;
        };
        /** @description Page about a code. */
        PageObject: {
            /** @description Names of other pages that match the request. */
            also?: string[];
            /** @description Name of the code, unique; as in `error_codes` of the status. */
            code: string;
            /** @description Text of the page, as `jtc explain` prints it: meaning, usual cause, remedy and next command. */
            text: string;
            /** @description Title for display. */
            title: string;
        };
        /** @description Parameter frame that the controller confirmed. */
        PartObject: {
            /** @description Length of its frame, bytes. */
            bytes: number;
            /** @description Name of the parameter. */
            parameter: string;
            /**
             * Format: double
             * @description Duration, s.
             */
            time_s: number;
            /**
             * Format: u-int32
             * @description Number of times that the frame must be sent: 2 for a friction table, otherwise 1.
             */
            times: number;
        };
        /** @description Payload at the flange. */
        PayloadObject: {
            /** @description Centre of mass in the frame of the flange, m. */
            com_m: number[];
            /** @description Inertia about the centre of mass, kg·m²: xx, xy, xz, yy, yz, zz. Zeros: a point mass. */
            inertia_kg_m2?: number[];
            /**
             * Format: double
             * @description Mass, kg; 0: no payload.
             */
            mass_kg: number;
        };
        /** @description Motion that passed the check. */
        PlanObject: {
            /** @description Limiting constraints, in the order of time. */
            binding: components["schemas"]["BoundObject"][];
            /**
             * Format: double
             * @description Duration, s.
             */
            duration_s: number;
            /** @description Results for each joint, from the base. */
            joints: components["schemas"]["JointPlan"][];
            kept?: components["schemas"]["TrajectoryObject"] | null;
            margin?: components["schemas"]["MarginObject"] | null;
            /** @description Notes for the user, for example about options that have no effect. */
            notes: string[];
            /** @description Number of points. */
            points: number;
            /**
             * Format: u-int16
             * @description Time between two points, ms.
             */
            step_ms: number;
            /** @description Trajectory as a file, for `PUT /api/trajectories/{number}` and `jtc traj run`. */
            text: string;
            /** @description Warnings, which do not prevent a run; a torque margin below 10 % is one of them. */
            warnings: string[];
            /** @description Time at which the motion is nearest to each waypoint, s. */
            waypoint_times_s: number[];
            /** @description Number of waypoints. */
            waypoints: number;
        };
        /** @description Waypoints, and options of the path through them. */
        PlanRequest: {
            /**
             * Format: double
             * @description Size of a rounded corner between two lines or arcs, m: the largest distance of the flange from the waypoint in
             *     the corner. 0: the arm stops at the waypoint.
             */
            blend_m?: number;
            /**
             * Format: double
             * @description Size of a rounded corner, rad: the path leaves the straight legs only within this distance from the waypoint.
             *     The distance is that of the joint that is furthest from the waypoint. 0: the arm stops at each waypoint.
             */
            blend_rad?: number;
            /** @description `true` if the angles are in degrees. */
            degrees?: boolean;
            keep?: components["schemas"]["KeepRequest"] | null;
            /** @description `true`: the flange moves on a straight line on each leg for which the waypoints do not specify the type of path. */
            line?: boolean;
            /**
             * Format: double
             * @description Torque margin for masses and friction that the model does not know, % of each limit.
             */
            margin_percent?: number;
            /**
             * @description `true`: the acceleration may change within 20 ms instead of 100 ms. The motion is faster, and stresses gears
             *     and payload more.
             */
            no_jerk_limit?: boolean;
            payload?: components["schemas"]["PayloadObject"] | null;
            /**
             * Format: double
             * @description Speed, % of the limits.
             */
            speed_percent?: number;
            /**
             * Format: double
             * @description Lowest bearing temperature that is expected during a run, °C; cold bearings need more torque.
             */
            temperature_c?: number;
            /**
             * @description Waypoints, 500 at most, as CSV or JSON in a format that `jtc plan` accepts. The columns are q1 to q6, or x, y, z with
             *     an orientation, or pose.
             */
            waypoints: string;
        };
        /** @description Trajectory for a plot. */
        PointsObject: {
            /**
             * @description Digest of points and step, 16 hexadecimal digits, for `POST /api/runs`. Other points or another step give another
             *     digest.
             */
            digest: string;
            /**
             * Format: double
             * @description Duration, s.
             */
            duration_s: number;
            /** @description Name for people. */
            name: string;
            /**
             * Format: u-int16
             * @description Number of the trajectory.
             */
            number: number;
            /** @description Joint positions at these times, from the base, rad. */
            positions_rad: number[][];
            /** @description Times of the points, s. */
            times_s: number[];
        };
        /**
         * @description Policy for a motion when the client that commanded it disconnects or falls silent.
         * @enum {string}
         */
        Policy: "continue" | "pause" | "stop";
        /**
         * @description Place where a pose is kept.
         * @enum {string}
         */
        PoseFrom: "arm file" | "agent";
        /** @description Named pose. */
        PoseObject: {
            /** @description Place where the pose is kept. */
            from: components["schemas"]["PoseFrom"];
            /** @description Name of the pose. */
            name: string;
            /** @description Joint positions, from the base, rad. */
            positions_rad: number[];
            /** @description Reason why the arm cannot move to the pose, in words; missing if a motion is possible. */
            warning?: string | null;
        };
        /** @description Position of a pose. */
        PoseRequest: {
            /** @description Joint positions, rad, from the base; missing: the current position of the arm. */
            positions_rad?: number[] | null;
        };
        /** @description Problem of a trajectory. */
        ProblemObject: {
            /**
             * Format: u-int8
             * @description Number of the joint; missing: the trajectory as a whole.
             */
            joint?: number | null;
            /**
             * Format: double
             * @description Limit of the value.
             */
            limit?: number | null;
            /** @description Message with value, limit and point. */
            message: string;
            /** @description Index of the worst point, from 0. */
            point: number;
            /**
             * Format: double
             * @description Time along the path, s.
             */
            time_s: number;
            /**
             * Format: double
             * @description Worst value; missing if it is not a number.
             */
            value?: number | null;
            /** @description `true` if the problem does not prevent a run. */
            warning: boolean;
        };
        /** @description Reactions of a controller to disturbances. */
        ReactionsObject: {
            /**
             * @description Joints with an encoder jump, counted from 1. The controller executes no trajectory until the drives of these
             *     joints are reset.
             */
            encoder_jumped: number[];
            /**
             * Format: double
             * @description Total time for which the controller slowed this run down because a torque was at its limit, s.
             */
            held_back_s: number;
            last_held_stop?: components["schemas"]["HeldStopObject"] | null;
            /**
             * Format: float
             * @description Speed along the path, in seconds of trajectory time per second of real time; 0 if no trajectory is executed.
             */
            path_rate: number;
            /** @description Joints, counted from 1, that yield to a push (J-68) or lower their load because of an overload (J-70). */
            yields: number[];
        };
        /** @description Options of a recovery. */
        RecoverRequest: {
            /** @description `true`: the limits of the controller are safe for this arm, although they differ from the limits of the file. */
            accept_device_limits?: boolean;
            /**
             * @description Text of an arm file or a robot description. The agent sends its friction, gains and model to the controller. Not
             *     possible together with `defaults`.
             */
            arm?: string | null;
            /**
             * @description `true`: a controller without arm parameters uses its defaults. These are the parameters of the stored arm, or of
             *     the built-in arm if no arm is stored.
             */
            defaults?: boolean;
        };
        /** @description Page that a browser opens without other files. */
        ReportPage: string;
        /** @description Nodes to restart. */
        ResetRequest: {
            /** @description `true` for all joints and the gripper. */
            all?: boolean;
            /** @description `true`: restart also under torque. Support the arm first: it may fall. */
            arm_may_fall?: boolean;
            /** @description `true` for the gripper. */
            gripper?: boolean;
            /** @description Joints, 1 to 6 from the base. */
            joints?: number[];
        };
        /** @description Results of a motion. */
        ResultObject: {
            /**
             * Format: double
             * @description Duration of the execution, s.
             */
            executed_s: number;
            /** @description Joints, from the base. */
            joints: components["schemas"]["JointResult"][];
        };
        /**
         * @description Permissions of a client.
         * @enum {string}
         */
        Role: "viewer" | "operator";
        /** @description Run of a kept trajectory. */
        RunRequest: {
            /** @description `true`: accept a controller that cannot report its limits. Its built-in limits must be safe for this arm. */
            accept_device_limits?: boolean;
            /**
             * @description `true`: if the arm is not at the first point, move it there before the run. The speed of this approach is
             *     `speed_percent` of the limits, at most 50 %. Without `speed_percent`, the speed is 10 %, and 25 % with a simulated
             *     controller.
             */
            approach?: boolean;
            /**
             * @description Digest of the trajectory that the client saw. The agent refuses the run if another trajectory is now stored
             *     under the number.
             */
            digest?: string | null;
            policy?: components["schemas"]["Policy"] | null;
            /**
             * Format: u-int32
             * @description Number of runs.
             */
            repeat?: number;
            /**
             * Format: double
             * @description Speed, % of the trajectory's own speed; missing: 100.
             */
            speed_percent?: number | null;
            /**
             * Format: u-int16
             * @description Number of the trajectory.
             */
            trajectory: number;
        };
        /** @description Command that the agent sends to the controller. */
        SentObject: {
            /**
             * Format: u-int64
             * @description Number of the command; `last_halt` has this value until the next Stop or Pause.
             */
            halt: number;
            /** @description Command: `stop` or `pause`. */
            sent: string;
        };
        /** @description New value of a setting. */
        SettingChange: {
            /**
             * Format: u-int8
             * @description Number of the joint, from the base; missing for a setting of the arm.
             */
            joint?: number | null;
            /** @description Name of the setting, with its unit. */
            name: string;
            /**
             * Format: double
             * @description Value; switches are 0 or 1.
             */
            value: number;
        };
        /** @description Setting of the controller. */
        SettingObject: {
            /**
             * Format: double
             * @description Highest value.
             */
            high: number;
            /**
             * Format: u-int8
             * @description Number of the joint, 1 to 6 from the base; missing: a setting of the whole arm.
             */
            joint?: number | null;
            /**
             * Format: double
             * @description Lowest value.
             */
            low: number;
            /** @description Meaning of the setting. */
            meaning: string;
            /** @description Name of the setting, with its unit. */
            name: string;
            /** @description `true` if the setting is stored with the arm and included in the hash of the arm. */
            of_arm: boolean;
            /** @description Unit; empty for a setting without a unit. */
            unit: string;
            /**
             * Format: double
             * @description Value; switches are 0 or 1.
             */
            value: number;
            /** @description Condition under which the setting may be changed. */
            when: components["schemas"]["When"];
            /** @description `true` if only whole numbers are possible. */
            whole: boolean;
        };
        /** @description Settings to change. The controller changes all of them, or none. */
        SettingsRequest: {
            /** @description Settings, each at most once. */
            settings: components["schemas"]["SettingChange"][];
        };
        /** @description Speed, % of the speed of the trajectory. */
        SpeedObject: {
            /**
             * Format: u-int8
             * @description Speed, 5 to 100 %.
             */
            percent: number;
        };
        /** @description Last status of the controller. */
        StatusObject: {
            /**
             * Format: u-int64
             * @description Age of the last status, ms; missing before the first status. At a high age, the values of the status are not
             *     current.
             */
            age_ms?: number | null;
            /** @description Number that identifies this run of the agent. */
            agent: string;
            /**
             * Format: u-int64
             * @description Time of this object since the start of the agent, ms. A client can use this time to detect that statuses arrive
             *     late, even if they arrive at a steady rate.
             */
            at_ms: number;
            /** @description Number of clients on the line. */
            clients: number;
            controller?: components["schemas"]["ControllerObject"] | null;
            /**
             * Format: u-int64
             * @description Number of the last event.
             */
            last_event: number;
            /**
             * Format: u-int64
             * @description Number of the last Stop or Pause: value of `asked_after` for new requests.
             */
            last_halt: number;
            lease?: components["schemas"]["LeaseObject"] | null;
            /** @description Reason why the port was lost; missing while it is available. */
            lost?: string | null;
            /** @description Name of the port. */
            port: string;
            /** @description Role of the caller. */
            role: components["schemas"]["Role"];
            /** @description `true` if the controller is simulated: no real arm moves. */
            simulated: boolean;
        };
        /** @description On or off. */
        Switch: {
            /** @description `true`: on. */
            on: boolean;
        };
        /** @description Kept trajectory. */
        TrajectoryObject: {
            /**
             * @description Digest of points and step, 16 hexadecimal digits, for `POST /api/runs`. Other points or another step give another
             *     digest.
             */
            digest: string;
            /**
             * Format: double
             * @description Duration, s.
             */
            duration_s: number;
            /** @description Name for people. */
            name: string;
            /** @description Notes about values that the agent derived or left out when it read the file. */
            notes: string[];
            /**
             * Format: u-int16
             * @description Number of the trajectory.
             */
            number: number;
            /** @description Number of points. */
            points: number;
            /**
             * Format: u-int16
             * @description Time between two points, ms.
             */
            step_ms: number;
        };
        /** @description Trajectory to keep. */
        TrajectoryRequest: {
            /** @description `true` if the angles are in degrees. */
            degrees?: boolean;
            /**
             * @description `true` if the numbers in the names of the joints determine their order. Otherwise, the agent refuses a file that
             *     names the joints of another arm.
             */
            joints_by_number?: boolean;
            /** @description Name of the trajectory for users. The agent uses the first 64 characters. */
            name: string;
            /**
             * @description Text of a file in a format that `jtc traj run` accepts: CSV with a time column and joints, JSON, or a ROS
             *     JointTrajectory. Recordings are not possible.
             */
            text: string;
        };
        /**
         * @description Condition under which a setting may be changed.
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
export type ArmEvent = components['schemas']['ArmEvent'];
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
