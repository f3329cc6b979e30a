// The objects of the agent's API, and what is newer than its description that this folder was generated from.
import type { ControllerObject, Happening, JointObject, StatusObject } from './api-types.ts';
import type { Entry } from '../connection.ts';

export type {
  ArmObject, BoundObject, CheckObject, Happening, InfoObject, JobObject, JointObject, JointPlan, JointResult, LogStatusObject,
  PayloadObject, PlanObject, PlanRequest, ProblemObject, ResultObject, SettingObject, SpeedObject, TrajectoryObject,
} from './api-types.ts';

export type Joint = JointObject & { error_codes?: string[] };

export type Controller = Omit<ControllerObject, 'joints'> & {
  joints: Joint[];
  /** Names for `explain`, beside the words. */
  error_codes?: string[];
  commanded_rad?: number[] | null;
};

export type Status = Omit<StatusObject, 'controller'> & { controller?: Controller | null };

export type ArmEntry = Entry & { event: Happening };

export interface Points {
  number: number;
  name: string;
  duration_s: number;
  times_s: number[];
  positions_rad: number[][];
}

export interface Pose {
  name: string;
  positions_rad: number[];
  from?: string;
  /** Why no motion leads there. */
  warning?: string | null;
}

export interface Page {
  code: string;
  title: string;
  text: string;
}
