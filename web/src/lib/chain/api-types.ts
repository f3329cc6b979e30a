// Made of docs/ucom-openapi.json by npm run types.
export type paths = Record<string, never>;
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /** @description State of a board, as the board reports it after a command. */
        AnswerObject: {
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            /** @description Flash date of its application. */
            flash_date?: string | null;
            /** @description State: `exloader`, `programming`, `started`, `running`. */
            state: string;
            /** @description Names of the status bits that are set. */
            status: string[];
        };
        /** @description Last known state of a board. */
        BoardObject: {
            /** @description `true` if the outputs of the board were enabled in its last report. */
            active: boolean;
            /** @description `true` if it has an application. */
            application: boolean;
            /** @description Description that the board reports. */
            description?: string | null;
            /**
             * Format: u-int64
             * @description Number of errors that it has reported.
             */
            errors: number;
            /** @description Flash date of the application. */
            flash_date?: string | null;
            /**
             * Format: u-int16
             * @description Flash number of the bootloader, which identifies the board; missing before the first answer of the board.
             */
            flash_number?: number | null;
            /**
             * Format: u-int64
             * @description Number of frames of this board in the last second.
             */
            frames_per_s: number;
            /** @description State of its heartbeats: `alive`, `late`, `lost`, or `none` if no heartbeats are expected. */
            heartbeat: string;
            /**
             * Format: double
             * @description Age of the last heartbeat, s.
             */
            heartbeat_age_s?: number | null;
            /** @description Last error that it has reported. */
            last_error?: string | null;
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            number: number;
            offers?: components["schemas"]["OffersObject"] | null;
            /**
             * Format: u-int16
             * @description Program ID of the application.
             */
            program_id?: number | null;
            /** @description State: `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`. */
            state: string;
            /** @description Names of the status bits that are set. */
            status: string[];
        };
        /** @description Event of the chain or a job. */
        ChainEvent: {
            /** @description Name of the holder; missing: no client holds the lease. */
            holder?: string | null;
            /** @enum {string} */
            kind: "lease";
        } | {
            /** @description Name of the client that requested it. */
            by: string;
            /** @enum {string} */
            kind: "halt";
            /**
             * Format: u-int64
             * @description Number of Stops that this event reports together, because they followed within 0.1 s; missing: a single
             *     Stop.
             */
            times?: number | null;
        } | {
            /** @description Numbers of the boards that have confirmed the Stop. */
            boards: number[];
            /** @enum {string} */
            kind: "stopped";
            /**
             * @description Boards that possibly still run, each with the reason. These include boards that ran before and do not
             *     answer now.
             */
            not_stopped: string[];
        } | {
            /**
             * Format: u-int8
             * @description Number of the board; missing: the agent does not know the board.
             */
            board?: number | null;
            /** @description Change: `late`, `lost`, `back`, or `rebooted`, after which the board has no number. */
            change: string;
            /** @enum {string} */
            kind: "heartbeat";
        } | {
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            /** @description Change: `left-loop`, `stopped-by-policy` or `in-loop`. */
            change: string;
            /** @enum {string} */
            kind: "loop";
        } | {
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            /** @enum {string} */
            kind: "state";
            /** @description State: `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`. */
            state: string;
        } | {
            /**
             * Format: u-int8
             * @description Number of the board; 0: a board without a number.
             */
            board: number;
            /**
             * Format: u-int8
             * @description Number of the error.
             */
            code: number;
            /** @enum {string} */
            kind: "board_error";
            /** @description Meaning of the error. */
            meaning: string;
            /** @description Name of the error. */
            name: string;
        } | {
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            /** @enum {string} */
            kind: "text";
            /** @description Text of the message. */
            text: string;
        } | {
            /** @enum {string} */
            kind: "note";
            /** @description Text of the note. */
            text: string;
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
            kind: "job_note";
            /** @description Text of the note. */
            text: string;
        } | {
            /**
             * Format: u-int32
             * @description Number of the attempt.
             */
            attempt: number;
            /** @description Numbers of boards that receive the image now. */
            boards: number[];
            /**
             * Format: u-int64
             * @description Number of bytes, of both cycles, that the boards have confirmed in this attempt.
             */
            bytes: number;
            /**
             * Format: u-int32
             * @description Cycle of the update. In cycle 1 the boards check the image; in cycle 2 they write it.
             */
            cycle: number;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "progress";
            /**
             * Format: u-int64
             * @description Number of bytes that the agent sends in both cycles.
             */
            total: number;
        } | {
            error?: components["schemas"]["ErrorObject"] | null;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            job: number;
            /** @enum {string} */
            kind: "ended";
            /** @description Outcome: `finished`, `cancelled` or `failed`. */
            outcome: string;
        };
        /** @description Boards of the chain. */
        ChainObject: {
            /** @description Boards with a number. */
            boards: components["schemas"]["FoundObject"][];
            /** @description Unusual observations; empty: none. */
            findings: string[];
        };
        /** @description State of this computer's CAN controller. */
        ControllerObject: {
            /** @description `true` if the CAN controller is bus-off. */
            bus_off: boolean;
            /** @description `true` if the CAN controller is error passive. */
            passive: boolean;
            /**
             * Format: u-int16
             * @description Receive error counter.
             */
            rec?: number | null;
            /**
             * Format: u-int16
             * @description Transmit error counter.
             */
            tec?: number | null;
            /**
             * Format: u-int64
             * @description Number of bus-off events.
             */
            times_bus_off: number;
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
            event: components["schemas"]["ChainEvent"];
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
        /** @description Expected board at a position of the chain. */
        ExpectedBoard: {
            /**
             * Format: u-int8
             * @description Position of the board in the chain. The board receives this number.
             */
            board: number;
            /**
             * Format: u-int16
             * @description Flash number of the bootloader, which identifies the board.
             */
            flash_number: number;
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
        /** @description Board that has answered during a scan or a numbering. */
        FoundObject: {
            /** @description Description that the board reports. */
            description?: string | null;
            /**
             * Format: u-int16
             * @description Flash number of the bootloader, which identifies the board.
             */
            flash_number: number;
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            number: number;
            /**
             * Format: u-int16
             * @description Program ID of its application.
             */
            program_id?: number | null;
            /** @description Names of the status bits that are set. */
            status: string[];
        };
        /** @description Value in a request. */
        GivenValue: boolean | number | string;
        /**
         * @description Format of an image.
         * @enum {string}
         */
        ImageFormat: "bin" | "hex" | "srec";
        /** @description Options of the numbering. */
        InitRequest: {
            /** @description Expected boards at their positions; other boards are an error. Empty: any boards. */
            expected?: components["schemas"]["ExpectedBoard"][];
        };
        /** @description Job, while it runs and afterwards. */
        JobObject: {
            chain?: components["schemas"]["ChainObject"] | null;
            /** @description Name of the client that requested it. */
            client: string;
            error?: components["schemas"]["ErrorObject"] | null;
            /** @description Findings of a doctor, worst first. */
            findings?: components["schemas"]["FindingObject"][] | null;
            /**
             * Format: u-int64
             * @description Number of the job.
             */
            number: number;
            run?: components["schemas"]["RunObject"] | null;
            /** @description Stage: `running`, `finished`, `cancelled` or `failed`. */
            stage: string;
            update?: components["schemas"]["UpdateObject"] | null;
            /** @description Description of the job. */
            what: string;
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
            /** @description Policy for running boards after the lease has lapsed. */
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
             * @description Time until the lease lapses without renewal, ms.
             */
            left_ms: number;
            /** @description Name of the client that waits for the lease. */
            wanted_by?: string | null;
        };
        /** @description Request for the lease. */
        LeaseRequest: {
            /** @description `true`: if another client holds the lease, ask that client for the lease, and wait. */
            ask?: boolean;
            /**
             * Format: double
             * @description Time without a request of this client after which the lease lapses, s.
             */
            lasts_s?: number;
            /** @description Name of the client for users. The agent uses the first 64 characters. */
            name: string;
            /** @description Policy for running boards after the lease has lapsed. */
            policy?: components["schemas"]["Policy"];
        };
        /** @description State of a lease. */
        LeaseState: {
            /** @description `true` if this client holds the lease. */
            held: boolean;
            /** @description Name of the client that waits for the lease. */
            wanted_by?: string | null;
        };
        /** @description Value of an input or a parameter. */
        NamedValue: {
            /**
             * Format: u-int8
             * @description Number of the board; missing: the value is for each board of the request.
             */
            board?: number | null;
            /** @description Name of the input or parameter. */
            name: string;
            /** @description New value. */
            value: components["schemas"]["GivenValue"];
        };
        /** @description Names of the values of a board's application. */
        OffersObject: {
            /** @description Description of the application. */
            description: string;
            /** @description Names of controller inputs. */
            inputs: string[];
            /** @description Names of sensor outputs. */
            outputs: string[];
            /** @description Names of parameters. */
            parameters: string[];
        };
        /** @description State of the outputs. */
        OutputsRequest: {
            /** @description `true`: enable the outputs. The control loop of the board must run. */
            active: boolean;
        };
        /**
         * @description Policy for running boards when the client that commanded them falls silent.
         * @enum {string}
         */
        Policy: "continue" | "stop";
        /** @description Boards that reported after a reset. */
        ResetObject: {
            /**
             * @description Low bytes of the flash numbers of these boards. The boards now have no board numbers: `POST /api/init` assigns new
             *     ones.
             */
            reports: number[];
        };
        /**
         * @description Permissions of a client.
         * @enum {string}
         */
        Role: "viewer" | "operator";
        /** @description Running boards. */
        RunObject: {
            /** @description Boards that run. */
            boards: components["schemas"]["RunningObject"][];
            /**
             * Format: double
             * @description Predicted bus load of these boards, %.
             */
            load_percent: number;
        };
        /** @description Boards to run, with their values. */
        RunRequest: {
            /** @description `true`: enable the outputs at the end. */
            active?: boolean;
            /** @description Numbers of the boards; empty: all boards that answer. */
            boards?: number[];
            /** @description Inputs that differ from the boards' initial values. */
            inputs?: components["schemas"]["NamedValue"][];
            /** @description Parameters to write. */
            parameters?: components["schemas"]["NamedValue"][];
        };
        /** @description Running board. */
        RunningObject: {
            /** @description `true` if its outputs are enabled. */
            active: boolean;
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
        };
        /** @description Command that was sent. */
        SentObject: {
            /**
             * Format: u-int64
             * @description Number of the Stop; `last_halt` has this value until the next Stop.
             */
            halt: number;
            /**
             * Format: u-int64
             * @description Number of the last event before the Stop. Later events report the results of the Stop.
             */
            last_event: number;
            /** @description Command: `stop`. */
            sent: string;
        };
        /** @description Status of the bus, and the lease. */
        StatusObject: {
            /**
             * Format: u-int64
             * @description Age of this status, ms.
             */
            age_ms: number;
            /** @description Number that identifies this run of the agent. */
            agent: string;
            /**
             * Format: u-int64
             * @description Time of this object since the start of the agent, ms. A client can use this time to detect that statuses arrive
             *     late, even if they arrive at a steady rate.
             */
            at_ms: number;
            /** @description Number of known boards. */
            boards: number;
            /** @description Name of the bus. */
            bus: string;
            /** @description `true` if another PC sends commands on this bus. */
            competing_master: boolean;
            controller?: components["schemas"]["ControllerObject"] | null;
            /**
             * Format: u-int64
             * @description Number of frames that do not belong to this protocol.
             */
            foreign_frames: number;
            /**
             * @description `true` if this agent sends heartbeats. The agent sends them after a command of the lease holder, and as long as
             *     a board that it has started is not stopped.
             */
            is_master: boolean;
            /**
             * Format: u-int64
             * @description Number of the last event.
             */
            last_event: number;
            /**
             * Format: u-int64
             * @description Number of the last Stop, 0 before the first: value of `asked_after` for new requests.
             */
            last_halt: number;
            lease?: components["schemas"]["LeaseObject"] | null;
            /**
             * Format: double
             * @description Load of the bus over the last second, %.
             */
            load_percent: number;
            /** @description Reason why the bus was lost; missing while it is available. */
            lost?: string | null;
            /**
             * Format: u-int64
             * @description Number of received frames, without frames of other protocols.
             */
            received: number;
            /** @description Role of the caller. */
            role: components["schemas"]["Role"];
            /**
             * Format: u-int64
             * @description Number of frames that this agent has sent.
             */
            sent: number;
            /** @description Board numbers that two boards share, in words. */
            shared_numbers: string[];
            /** @description `true` if the boards are simulated: nothing moves. */
            simulated: boolean;
        };
        /** @description Board to update. */
        TargetRequest: {
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            /**
             * Format: u-int16
             * @description Flash number that the board must have; missing: any flash number.
             */
            flash_number?: number | null;
        };
        /**
         * @description Unit of the addresses in records.
         * @enum {string}
         */
        Unit: "byte" | "word";
        /** @description Result of an update. */
        UpdateObject: {
            /** @description Results for each board. */
            boards: components["schemas"]["UpdatedObject"][];
            /**
             * Format: u-int64
             * @description Number of bytes that the agent sends in both cycles of the update.
             */
            bytes: number;
            /** @description `true` if the agent sent only requests that change nothing. */
            dry_run: boolean;
            /** @description Changes that the agent made to the images, such as a gap that it filled. */
            notes: string[];
            /**
             * Format: u-int16
             * @description Program ID that the boards must show; missing: not known.
             */
            program_id?: number | null;
            /** @description Reason why the Program ID is not known. */
            unverifiable?: string | null;
        };
        /** @description Update of boards. */
        UpdateRequest: {
            /**
             * @description `true`: accept a result that cannot be verified. This includes a board that already shows the program, but whose
             *     flash contents are not known.
             */
            accept_unverified?: boolean;
            addresses?: components["schemas"]["Unit"] | null;
            /** @description Boards to update. */
            boards: components["schemas"]["TargetRequest"][];
            /** @description Flash date, as `2009-06-01`; missing: today, but a board that already shows the program keeps its date. */
            date?: string | null;
            /** @description `true`: run only the checks. */
            dry_run?: boolean;
            /**
             * Format: u-int16
             * @description Program ID that the boards must show at the end.
             */
            expect_program_id?: number | null;
            /**
             * Format: u-int8
             * @description Byte that fills gaps between records, for example 255, the erased state of flash; missing: an image with a gap
             *     is refused.
             */
            fill_gaps?: number | null;
            /** @description `true`: update even if boards run, another PC is on the bus, or the board already shows the program. */
            force?: boolean;
            format?: components["schemas"]["ImageFormat"] | null;
            /** @description `true`: update all boards at once, by broadcast. */
            group?: boolean;
            /** @description Image, as base64. */
            image: string;
            /** @description `true`: update even if the board already shows the program; all checks still apply. */
            rewrite?: boolean;
            /** @description Second image, as base64; needed only if the plan of the profile sends a different image in each cycle. */
            second?: string | null;
            /** @description `true`: start the application at the end. */
            start?: boolean;
        };
        /** @description Result of an update for one board. */
        UpdatedObject: {
            /**
             * Format: u-int32
             * @description Number of attempts.
             */
            attempts: number;
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            error?: components["schemas"]["ErrorObject"] | null;
            /**
             * Format: u-int16
             * @description Flash number of the bootloader, which identifies the board.
             */
            flash_number?: number | null;
            /**
             * @description Outcome: `not-started`, `cancelled`, `up-to-date`, `program-up-to-date`, `incomplete`, `unknown`, `written`,
             *     `verified` or `running`.
             */
            outcome: string;
            /**
             * Format: u-int16
             * @description Program ID read back after the update.
             */
            program_id_after?: number | null;
            /**
             * Format: u-int16
             * @description Program ID read back before the update.
             */
            program_id_before?: number | null;
            /**
             * Format: double
             * @description Duration, s.
             */
            time_s: number;
            /**
             * @description `true` if the result is verified: the board reports the Program ID and date of the image. In addition, the
             *     records show that exactly this image was written to this address, in this update or in an earlier one.
             */
            verified: boolean;
        };
        /** @description Value of a signal. */
        ValueObject: {
            /** @description Index in the buffer. */
            index: number;
            /**
             * Format: double
             * @description Largest value, in its unit, if the signal table has one.
             */
            max?: number | null;
            /**
             * Format: double
             * @description Smallest value, in its unit, if the signal table has one.
             */
            min?: number | null;
            /** @description Name of the signal. */
            name: string;
            /** @description Value with its unit, for people. */
            text?: string | null;
            /** @description Unit of the signal, if the signal table has one. */
            unit?: string | null;
            /**
             * @description Value as the signal table defines it: a number in its unit, `true` or `false`, or a word as text. Missing if the
             *     value is not known.
             */
            value?: unknown;
        };
        /** @description New value of an input or a parameter. */
        ValueRequest: {
            /** @description New value. */
            value: components["schemas"]["GivenValue"];
        };
        /** @description Values of a board. */
        ValuesObject: {
            /**
             * Format: double
             * @description Age of its outputs, s; missing before the first outputs.
             */
            age_s?: number | null;
            /**
             * Format: u-int8
             * @description Number of the board.
             */
            board: number;
            /**
             * @description Controller inputs as last set, or with their initial values. An input has no value if this agent has neither set
             *     nor read it since the application started.
             */
            inputs: components["schemas"]["ValueObject"][];
            /** @description Sensor outputs; empty before the first outputs. */
            outputs: components["schemas"]["ValueObject"][];
            /**
             * @description Parameters as last written by this agent. A parameter has no value if this agent has not written it since the
             *     application started, because boards cannot report their parameters.
             */
            parameters: components["schemas"]["ValueObject"][];
            /**
             * @description `true` if the outputs are not current: they are older than 0.5 s, or the board is late, lost, rebooted or not in its control
             *     loop.
             */
            stale: boolean;
        };
    };
    responses: never;
    parameters: never;
    requestBodies: never;
    headers: never;
    pathItems: never;
}
export type AnswerObject = components['schemas']['AnswerObject'];
export type BoardObject = components['schemas']['BoardObject'];
export type ChainEvent = components['schemas']['ChainEvent'];
export type ChainObject = components['schemas']['ChainObject'];
export type ControllerObject = components['schemas']['ControllerObject'];
export type ErrorObject = components['schemas']['ErrorObject'];
export type EventObject = components['schemas']['EventObject'];
export type EventsObject = components['schemas']['EventsObject'];
export type ExpectedBoard = components['schemas']['ExpectedBoard'];
export type FindingObject = components['schemas']['FindingObject'];
export type FoundObject = components['schemas']['FoundObject'];
export type GivenValue = components['schemas']['GivenValue'];
export type ImageFormat = components['schemas']['ImageFormat'];
export type InitRequest = components['schemas']['InitRequest'];
export type JobObject = components['schemas']['JobObject'];
export type LeaseGrant = components['schemas']['LeaseGrant'];
export type LeaseObject = components['schemas']['LeaseObject'];
export type LeaseRequest = components['schemas']['LeaseRequest'];
export type LeaseState = components['schemas']['LeaseState'];
export type NamedValue = components['schemas']['NamedValue'];
export type OffersObject = components['schemas']['OffersObject'];
export type OutputsRequest = components['schemas']['OutputsRequest'];
export type Policy = components['schemas']['Policy'];
export type ResetObject = components['schemas']['ResetObject'];
export type Role = components['schemas']['Role'];
export type RunObject = components['schemas']['RunObject'];
export type RunRequest = components['schemas']['RunRequest'];
export type RunningObject = components['schemas']['RunningObject'];
export type SentObject = components['schemas']['SentObject'];
export type StatusObject = components['schemas']['StatusObject'];
export type TargetRequest = components['schemas']['TargetRequest'];
export type Unit = components['schemas']['Unit'];
export type UpdateObject = components['schemas']['UpdateObject'];
export type UpdateRequest = components['schemas']['UpdateRequest'];
export type UpdatedObject = components['schemas']['UpdatedObject'];
export type ValueObject = components['schemas']['ValueObject'];
export type ValueRequest = components['schemas']['ValueRequest'];
export type ValuesObject = components['schemas']['ValuesObject'];
export type $defs = Record<string, never>;
export type operations = Record<string, never>;
