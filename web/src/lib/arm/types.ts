// Objects of the agent's API, under the names that the page uses.
import type { ControllerObject, ArmEvent, PageObject, PointsObject, PoseObject, StatusObject } from './api-types.ts';
import type { Entry } from '../connection.ts';

export type {
  ArmObject, BoundObject, CheckObject, DoctorObject, ArmEvent, InfoObject, JobObject, JointObject, JointPlan, JointResult, LogStatusObject, LogValues,
  PayloadObject, PlanObject, PlanRequest, ProblemObject, ResultObject, SettingObject, SpeedObject, TrajectoryObject,
} from './api-types.ts';

export type Controller = ControllerObject;
export type Status = StatusObject;
/** Points of a trajectory. A trajectory that is not stored on the agent has no digest. */
export type Points = Omit<PointsObject, 'digest'> & { digest?: string };
export type Pose = PoseObject;
export type Page = PageObject;

export type ArmEntry = Entry & { event: ArmEvent };
