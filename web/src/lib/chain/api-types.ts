// Made of docs/ucom-openapi.json by npm run types.
export type paths = Record<string, never>;
export type webhooks = Record<string, never>;
export interface components {
    schemas: {
        /** @description A board after a command, as it answered. */
        AnswerObject: {
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            /** @description When its application was flashed. */
            flash_date?: string | null;
            /** @description What it does: `exloader`, `programming`, `started`, `running`. */
            state: string;
            /** @description The bits of its status that are set. */
            status: string[];
        };
        /** @description A board as last seen. */
        BoardObject: {
            /** @description Its outputs are enabled, as it last reported. */
            active: boolean;
            /** @description It has an application. */
            application: boolean;
            /** @description Its description of itself. */
            description?: string | null;
            /**
             * Format: u-int64
             * @description Errors that it has reported.
             */
            errors: number;
            /** @description When that was flashed. */
            flash_date?: string | null;
            /**
             * Format: u-int16
             * @description Number of its bootloader: who it is; missing before it has answered.
             */
            flash_number?: number | null;
            /**
             * Format: u-int64
             * @description Frames of it in the last second.
             */
            frames_per_s: number;
            /** @description Its heartbeats: `alive`, `late`, `lost`, or `none` where none is expected. */
            heartbeat: string;
            /**
             * Format: double
             * @description Since the last heartbeat, s.
             */
            heartbeat_age_s?: number | null;
            /** @description The last of them. */
            last_error?: string | null;
            /**
             * Format: u-int8
             * @description Its number.
             */
            number: number;
            offers?: components["schemas"]["OffersObject"] | null;
            /**
             * Format: u-int16
             * @description Program ID of that.
             */
            program_id?: number | null;
            /** @description `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`. */
            state: string;
            /** @description The bits of its status that are set. */
            status: string[];
        };
        /** @description Who is there. */
        ChainObject: {
            /** @description Boards with a number. */
            boards: components["schemas"]["FoundObject"][];
            /** @description What is worth a word; empty: nothing is odd. */
            findings: string[];
        };
        /** @description How the CAN controller of this computer gets on with the bus. */
        ControllerObject: {
            /** @description It has left the bus. */
            bus_off: boolean;
            /** @description It is error passive. */
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
             * @description How often it has.
             */
            times_bus_off: number;
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
        /** @description A board that is expected at its place. */
        ExpectedBoard: {
            /**
             * Format: u-int8
             * @description Its place, which is its number.
             */
            board: number;
            /**
             * Format: u-int16
             * @description Number of its bootloader: who it is.
             */
            flash_number: number;
        };
        /** @description What a doctor found. */
        FindingObject: {
            /** @description What helps; may be empty. */
            next: string;
            /** @description `problem`, `warning` or `good`. */
            severity: string;
            /** @description What was found. */
            what: string;
            /** @description What probably is the cause; may be empty. */
            why: string;
        };
        /** @description A board as it answered. */
        FoundObject: {
            /** @description Its description of itself. */
            description?: string | null;
            /**
             * Format: u-int16
             * @description Number of its bootloader: who it is.
             */
            flash_number: number;
            /**
             * Format: u-int8
             * @description Its number.
             */
            number: number;
            /**
             * Format: u-int16
             * @description Program ID of its application.
             */
            program_id?: number | null;
            /** @description The bits of its status that are set. */
            status: string[];
        };
        /** @description A value as it is given. */
        GivenValue: boolean | number | string;
        /** @description What has happened. */
        Happening: {
            /** @description Its name; missing: nobody commands. */
            holder?: string | null;
            /** @enum {string} */
            kind: "lease";
        } | {
            /** @description Who it was. */
            by: string;
            /** @enum {string} */
            kind: "halt";
            /**
             * Format: u-int64
             * @description So many Stops, within a tenth of a second, of which this was the last; missing: one.
             */
            times?: number | null;
        } | {
            /** @description Boards that have confirmed it. */
            boards: number[];
            /** @enum {string} */
            kind: "stopped";
            /** @description Boards that may still run, each with the reason: also those that ran and from which nothing is received any more. */
            not_stopped: string[];
        } | {
            /**
             * Format: u-int8
             * @description Its number; missing: a board that is not known.
             */
            board?: number | null;
            /** @description `late`, `lost`, `back`, or `rebooted`: it has no number any more. */
            change: string;
            /** @enum {string} */
            kind: "heartbeat";
        } | {
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            /** @description `left-loop`, `stopped-by-policy` or `in-loop`. */
            change: string;
            /** @enum {string} */
            kind: "loop";
        } | {
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            /** @enum {string} */
            kind: "state";
            /** @description `exloader`, `programming`, `started`, `running`, `lost`, `rebooted` or `?`. */
            state: string;
        } | {
            /**
             * Format: u-int8
             * @description Its number; 0: one without a number.
             */
            board: number;
            /**
             * Format: u-int8
             * @description Number of the error.
             */
            code: number;
            /** @enum {string} */
            kind: "board_error";
            /** @description What it means. */
            meaning: string;
            /** @description Its name. */
            name: string;
        } | {
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            /** @enum {string} */
            kind: "text";
            /** @description The text. */
            text: string;
        } | {
            /** @enum {string} */
            kind: "note";
            /** @description In words. */
            text: string;
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
            kind: "job_note";
            /** @description In words. */
            text: string;
        } | {
            /**
             * Format: u-int32
             * @description Which attempt.
             */
            attempt: number;
            /** @description Boards that get the image now. */
            boards: number[];
            /**
             * Format: u-int64
             * @description Bytes of both cycles that were taken.
             */
            bytes: number;
            /**
             * Format: u-int32
             * @description 1: checked, 2: written.
             */
            cycle: number;
            /**
             * Format: u-int64
             * @description The job.
             */
            job: number;
            /** @enum {string} */
            kind: "progress";
            /**
             * Format: u-int64
             * @description Of so many.
             */
            total: number;
        } | {
            error?: components["schemas"]["ErrorObject"] | null;
            /**
             * Format: u-int64
             * @description Its number.
             */
            job: number;
            /** @enum {string} */
            kind: "ended";
            /** @description `finished`, `cancelled` or `failed`. */
            outcome: string;
        };
        /**
         * @description Form of an image.
         * @enum {string}
         */
        ImageFormat: "bin" | "hex" | "srec";
        /** @description How the chain is numbered. */
        InitRequest: {
            /** @description Boards that are expected at their places: others are an error. Empty: whoever is there. */
            expected?: components["schemas"]["ExpectedBoard"][];
        };
        /** @description A job, while it goes on and afterwards. */
        JobObject: {
            chain?: components["schemas"]["ChainObject"] | null;
            /** @description Who asked for it. */
            client: string;
            error?: components["schemas"]["ErrorObject"] | null;
            /** @description Of a doctor: what was found, the worst first. */
            findings?: components["schemas"]["FindingObject"][] | null;
            /**
             * Format: u-int64
             * @description Its number.
             */
            number: number;
            run?: components["schemas"]["RunObject"] | null;
            /** @description `running`, `finished`, `cancelled` or `failed`. */
            stage: string;
            update?: components["schemas"]["UpdateObject"] | null;
            /** @description What it does. */
            what: string;
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
            /** @description What becomes of running boards when it has lapsed. */
            policy: components["schemas"]["Policy"];
        };
        /** @description Who commands. */
        LeaseObject: {
            /**
             * Format: u-int64
             * @description Since when, ms.
             */
            age_ms: number;
            /** @description Its name. */
            holder: string;
            /**
             * Format: u-int64
             * @description Until it lapses, ms.
             */
            left_ms: number;
            /** @description Who asks for it. */
            wanted_by?: string | null;
        };
        /** @description Who wants to command. */
        LeaseRequest: {
            /** @description Where another client commands: ask it for the lease, and wait for it. */
            ask?: boolean;
            /**
             * Format: double
             * @description How long the lease lasts without a request of this client, s.
             */
            lasts_s?: number;
            /** @description What people are to call it: the first 64 characters. */
            name: string;
            /** @description What becomes of running boards when it has lapsed. */
            policy?: components["schemas"]["Policy"];
        };
        /** @description How a lease is. */
        LeaseState: {
            /** @description This client commands. */
            held: boolean;
            /** @description Who asks for the lease. */
            wanted_by?: string | null;
        };
        /** @description A value of an input or a parameter. */
        NamedValue: {
            /**
             * Format: u-int8
             * @description The board; missing: each of those that are to run.
             */
            board?: number | null;
            /** @description Its name. */
            name: string;
            /** @description The value. */
            value: components["schemas"]["GivenValue"];
        };
        /** @description Names of what a board's application has. */
        OffersObject: {
            /** @description The description of the application. */
            description: string;
            /** @description Controller inputs. */
            inputs: string[];
            /** @description Sensor outputs. */
            outputs: string[];
            /** @description Parameters. */
            parameters: string[];
        };
        /** @description Whether outputs are enabled. */
        OutputsRequest: {
            /** @description True: enabled, where the control loop runs. */
            active: boolean;
        };
        /**
         * @description What becomes of running boards when the client that commanded them shows no more that it is there.
         * @enum {string}
         */
        Policy: "continue" | "stop";
        /** @description Who reported after a reset. */
        ResetObject: {
            /** @description Low bytes of the boards' flash numbers. Their numbers are gone: `POST /api/init` gives new ones. */
            reports: number[];
        };
        /**
         * @description What a client may do.
         * @enum {string}
         */
        Role: "viewer" | "operator";
        /** @description What runs. */
        RunObject: {
            /** @description The boards. */
            boards: components["schemas"]["RunningObject"][];
            /**
             * Format: double
             * @description Load that they make on the bus, by forecast, %.
             */
            load_percent: number;
        };
        /** @description What is to run. */
        RunRequest: {
            /** @description Outputs are enabled at the end. */
            active?: boolean;
            /** @description Numbers of the boards; empty: all that answer. */
            boards?: number[];
            /** @description Inputs that differ from the boards' initial ones. */
            inputs?: components["schemas"]["NamedValue"][];
            /** @description Parameters. */
            parameters?: components["schemas"]["NamedValue"][];
        };
        /** @description A board that runs. */
        RunningObject: {
            /** @description Its outputs are enabled. */
            active: boolean;
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
        };
        /** @description What was sent. */
        SentObject: {
            /**
             * Format: u-int64
             * @description Its number: `last_halt` until the next.
             */
            halt: number;
            /**
             * Format: u-int64
             * @description Number of the last event before it: what came of it follows.
             */
            last_event: number;
            /** @description `stop`. */
            sent: string;
        };
        /** @description The bus, and who commands. */
        StatusObject: {
            /**
             * Format: u-int64
             * @description How old this is, ms.
             */
            age_ms: number;
            /** @description Which agent this is, by a number that it was given at its start. */
            agent: string;
            /**
             * Format: u-int64
             * @description Time of this agent when this was made: since it began, ms. Who reads that it is long ago receives late, however steadily.
             */
            at_ms: number;
            /** @description Boards that are known. */
            boards: number;
            /** @description The bus. */
            bus: string;
            /** @description Another PC commands on this bus. */
            competing_master: boolean;
            controller?: components["schemas"]["ControllerObject"] | null;
            /**
             * Format: u-int64
             * @description Frames that are not of this protocol.
             */
            foreign_frames: number;
            /** @description This agent sends heartbeats: who has the lease has commanded something, or boards that it has started are not stopped. */
            is_master: boolean;
            /**
             * Format: u-int64
             * @description Number of the last event.
             */
            last_event: number;
            /**
             * Format: u-int64
             * @description Number of the last Stop, 0 before the first: `asked_after` of what is asked for now.
             */
            last_halt: number;
            lease?: components["schemas"]["LeaseObject"] | null;
            /**
             * Format: double
             * @description Load of the bus over the last second, %.
             */
            load_percent: number;
            /** @description Why the bus is gone; missing while it is there. */
            lost?: string | null;
            /**
             * Format: u-int64
             * @description Frames that were received, and sent.
             */
            received: number;
            /** @description What the caller may do. */
            role: components["schemas"]["Role"];
            /**
             * Format: u-int64
             * @description Frames that this agent has sent.
             */
            sent: number;
            /** @description Numbers that two boards have, in words. */
            shared_numbers: string[];
            /** @description Nothing moves: the boards are simulated. */
            simulated: boolean;
        };
        /** @description A board that is to be updated. */
        TargetRequest: {
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            /**
             * Format: u-int16
             * @description Number of its bootloader, which it must have; missing: whoever has that number.
             */
            flash_number?: number | null;
        };
        /**
         * @description What addresses of records count.
         * @enum {string}
         */
        Unit: "byte" | "word";
        /** @description What became of an update. */
        UpdateObject: {
            /** @description Each board. */
            boards: components["schemas"]["UpdatedObject"][];
            /**
             * Format: u-int64
             * @description Bytes of both cycles.
             */
            bytes: number;
            /** @description Nothing was sent but questions. */
            dry_run: boolean;
            /**
             * Format: u-int16
             * @description Program ID that the boards must show; missing: nobody knows.
             */
            program_id?: number | null;
            /** @description Why nobody knows it. */
            unverifiable?: string | null;
        };
        /** @description An update. */
        UpdateRequest: {
            /** @description What cannot be verified is as good as what was: also a board that shows the program, of whose flash nothing is known. */
            accept_unverified?: boolean;
            addresses?: components["schemas"]["Unit"] | null;
            /** @description The boards. */
            boards: components["schemas"]["TargetRequest"][];
            /** @description Flash date, as `2009-06-01`; missing: today, and a board that shows the program keeps its date. */
            date?: string | null;
            /** @description Only the checks. */
            dry_run?: boolean;
            /**
             * Format: u-int16
             * @description Program ID that the boards must show at the end.
             */
            expect_program_id?: number | null;
            /** @description Gaps between records are filled with FF. */
            fill_gaps?: boolean;
            /** @description Also when boards run, another PC is on the bus, or the board shows the program already. */
            force?: boolean;
            format?: components["schemas"]["ImageFormat"] | null;
            /** @description All boards at once, by broadcast. */
            group?: boolean;
            /** @description The image, as base64. */
            image: string;
            /** @description Also when the board shows the program already; lifts no check. */
            rewrite?: boolean;
            /** @description What the other cycle carries, as base64, where the profile's plan sends two images. */
            second?: string | null;
            /** @description Start the application at the end. */
            start?: boolean;
        };
        /** @description What became of a board in an update. */
        UpdatedObject: {
            /**
             * Format: u-int32
             * @description How often it was tried.
             */
            attempts: number;
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            error?: components["schemas"]["ErrorObject"] | null;
            /**
             * Format: u-int16
             * @description Who it is.
             */
            flash_number?: number | null;
            /** @description `not-started`, `cancelled`, `up-to-date`, `program-up-to-date`, `incomplete`, `unknown`, `written`, `verified` or `running`. */
            outcome: string;
            /**
             * Format: u-int16
             * @description Program ID that was read back.
             */
            program_id_after?: number | null;
            /**
             * Format: u-int16
             * @description Program ID that it had, and that was read back.
             */
            program_id_before?: number | null;
            /**
             * Format: double
             * @description s.
             */
            time_s: number;
            /**
             * @description The board shows the Program ID and date of the image, and the agent or its inventory has it that exactly this image was
             *     written to this address: now, or before.
             */
            verified: boolean;
        };
        /** @description A value. */
        ValueObject: {
            /** @description Its place in the buffer. */
            index: number;
            /**
             * Format: double
             * @description Greatest value, alike.
             */
            max?: number | null;
            /**
             * Format: double
             * @description Least value, in its unit, where the signal table has one.
             */
            min?: number | null;
            /** @description Its name. */
            name: string;
            /** @description For people, with its unit. */
            text?: string | null;
            /** @description Its unit, where the signal table has one. */
            unit?: string | null;
            /** @description The number in its unit, true or false, or a word as text, by the signal table; missing where it is not known. */
            value?: unknown;
        };
        /** @description What an input or a parameter is to be. */
        ValueRequest: {
            /** @description The value. */
            value: components["schemas"]["GivenValue"];
        };
        /** @description Values of a board. */
        ValuesObject: {
            /**
             * Format: double
             * @description Since its outputs came, s; missing before the first.
             */
            age_s?: number | null;
            /**
             * Format: u-int8
             * @description Its number.
             */
            board: number;
            /**
             * @description Controller inputs as last set, or as the board began with them; without a value where this agent has neither set nor read them
             *     since the application started.
             */
            inputs: components["schemas"]["ValueObject"][];
            /** @description Sensor outputs; empty before the first. */
            outputs: components["schemas"]["ValueObject"][];
            /** @description Parameters as this agent believes them to be: boards have no way to read them back. */
            parameters: components["schemas"]["ValueObject"][];
            /** @description These are not the outputs of now: they are older than half a second, or the board is late or lost, or has left its control loop. */
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
export type ChainObject = components['schemas']['ChainObject'];
export type ControllerObject = components['schemas']['ControllerObject'];
export type ErrorObject = components['schemas']['ErrorObject'];
export type EventObject = components['schemas']['EventObject'];
export type EventsObject = components['schemas']['EventsObject'];
export type ExpectedBoard = components['schemas']['ExpectedBoard'];
export type FindingObject = components['schemas']['FindingObject'];
export type FoundObject = components['schemas']['FoundObject'];
export type GivenValue = components['schemas']['GivenValue'];
export type Happening = components['schemas']['Happening'];
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
