// Types of the API of a chain's agent, from its OpenAPI description. The messages of the agent's stream are also
// declared here, because OpenAPI does not cover them.
import type { Entry } from '../connection.ts';
import type { SessionStatus } from '../session.svelte.ts';
import type { BoardObject, ChainEvent, StatusObject, ValueObject } from './api-types.ts';

export type { BoardObject, ChainObject, FindingObject, ChainEvent, JobObject, UpdateObject, UpdateRequest, UpdatedObject } from './api-types.ts';

/** Limits of the signal table, if the agent sends them. */
export type Value = ValueObject & { min?: number | null; max?: number | null };

export interface Values {
  board: number;
  age_s?: number | null;
  stale: boolean;
  outputs: Value[];
  inputs: Value[];
  parameters: Value[];
}

export type Status = StatusObject & SessionStatus;

export interface ChainEntry extends Entry {
  event: ChainEvent;
}

export interface BoardsMessage {
  kind: 'boards';
  boards: BoardObject[];
}

export interface ValuesMessage {
  kind: 'values';
  values: Values[];
}
