// 3D scene of the arm. The scene is loaded only when it is shown, and is drawn only after a change.
import {
  AmbientLight, ArrowHelper, BufferGeometry, CircleGeometry, Color, DirectionalLight, DoubleSide, Float32BufferAttribute, GridHelper, Group, HemisphereLight, Line,
  LineBasicMaterial, LineDashedMaterial, Mesh, MeshBasicMaterial, MeshStandardMaterial, type Object3D, PCFShadowMap, PerspectiveCamera, RingGeometry, Scene,
  ShadowMaterial, SphereGeometry, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';

import { type ArmModel, forward, place, reach, room, type Vector } from './kinematics.ts';
import { type Body, bodyOf, housingRadius, type Materials } from './shapes.ts';

export interface Palette {
  ground: string;
  surface: string;
  line: string;
  ink: string;
  accent: string;
  warn: string;
  error: string;
  ghost: string;
  body: string;
  link: string;
  cap: string;
  dark: boolean;
}

export interface Shown {
  limits: boolean;
  trail: boolean;
  path: boolean;
  /** True: the scene shows the limits of all joints, and the direction of gravity. */
  all: boolean;
}

/** Renderer of the scene. Tests replace it, because they have no WebGL. */
export type Renderer = Pick<WebGLRenderer, 'render' | 'setPixelRatio' | 'setSize' | 'dispose' | 'shadowMap'>;

const TRAIL = 400;
/** Distance between commanded and measured position above which the ghost is shown, rad. */
const APART_RAD = 0.004;
/**
 * Distance to a limit, as a share of half the range of a joint. The range is shaded if the joint is closer to a limit.
 */
const NEAR = 0.12;

export class ArmScene {
  readonly #renderer: Renderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(32, 1, 0.02, 40);
  readonly #controls: OrbitControls;
  readonly #sun = new DirectionalLight(0xffffff, 2.2);
  readonly #sky = new HemisphereLight(0xffffff, 0x8899aa, 1.1);
  #model: ArmModel | undefined;
  #body: Body | undefined;
  #ghost: Body | undefined;
  #limits: Group[] = [];
  #needles: Mesh[] = [];
  #materials: Materials | undefined;
  #rings: MeshStandardMaterial[] = [];
  readonly #ghostMaterial = new MeshStandardMaterial({ transparent: true, opacity: 0.34, depthWrite: false, roughness: 0.6 });
  #floor: Group | undefined;
  readonly #trail = new Line(new BufferGeometry(), new LineBasicMaterial({ transparent: true, opacity: 0.9 }));
  readonly #path = new Line(new BufferGeometry(), new LineDashedMaterial({ dashSize: 0.02, gapSize: 0.012 }));
  readonly #marks = new Group();
  readonly #payload = new Mesh(new SphereGeometry(1, 32, 20), new MeshStandardMaterial({ transparent: true, opacity: 0.75, roughness: 0.5 }));
  #trailPoints: Vector[] = [];
  #q: number[] = [];
  /** Joint positions of the ghost, and its visibility. The scene keeps both values when it creates a new body. */
  #ghostQ: number[] = [];
  #ghostShown = false;
  #palette: Palette;
  #shown: Shown = { limits: true, trail: true, path: true, all: false };
  #gravity: ArrowHelper | undefined;
  #pointed: number | undefined;
  #asked = false;
  #lost = false;
  /** Number of drawn pictures. Tests check with it that the scene draws no picture without a change. */
  drawn = 0;

  constructor(canvas: HTMLCanvasElement, palette: Palette, renderer: Renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: 'low-power' })) {
    this.#renderer = renderer;
    this.#renderer.shadowMap.enabled = true;
    this.#renderer.shadowMap.type = PCFShadowMap;
    this.#palette = palette;
    this.#camera.up.set(0, 0, 1);
    this.#controls = new OrbitControls(this.#camera, canvas);
    this.#controls.enableDamping = false;
    this.#controls.maxPolarAngle = Math.PI * 0.56;
    this.#controls.addEventListener('change', () => this.ask());
    this.#sun.castShadow = true;
    this.#sun.shadow.mapSize.set(1024, 1024);
    this.#sun.shadow.radius = 5;
    this.#sun.shadow.bias = -0.0006;
    this.#sun.shadow.normalBias = 0.006;
    this.#scene.add(this.#sun, this.#sun.target, this.#sky, new AmbientLight(0xffffff, 0.35), this.#trail, this.#path, this.#marks);
    this.#trail.frustumCulled = this.#path.frustumCulled = false;
    this.paint(palette);
    this.view('home');
  }

  /** Requests a picture in the next frame. Several requests before that frame give one picture. */
  ask(): void {
    if (this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.drawn += 1;
      this.#renderer.render(this.#scene, this.#camera);
    });
  }

  resize(width: number, height: number, ratio: number): void {
    if (width < 2 || height < 2) return;
    this.#renderer.setPixelRatio(Math.min(ratio, 2));
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    // In a tall picture the field of view is larger, so that it shows the whole width of the arm.
    this.#camera.fov = width < height ? 32 * Math.min(1.8, height / width) : 32;
    this.#camera.updateProjectionMatrix();
    this.ask();
  }

  view(which: 'home' | 'front' | 'side' | 'top'): void {
    const r = this.#model ? reach(this.#model) : 1.6;
    const height = r * 0.45;
    const far = r * 1.95;
    const from = { home: [0.92, -1, 0.55], front: [1, 0, 0.12], side: [0, -1, 0.12], top: [0.001, 0, 1] }[which] as Vector;
    const way = new Vector3(...from).normalize().multiplyScalar(far);
    this.#controls.target.set(0, 0, which === 'top' ? 0 : height);
    this.#camera.position.copy(this.#controls.target).add(way);
    this.#controls.minDistance = r * 0.35;
    this.#controls.maxDistance = r * 5;
    this.#controls.update();
    this.ask();
  }

  /** Rotates the camera around the arm when the user presses keys. */
  turn(across: number, up: number, zoom = 1): void {
    const offset = this.#camera.position.clone().sub(this.#controls.target);
    const radius = offset.length() / zoom;
    const azimuth = Math.atan2(offset.y, offset.x) + across;
    const polar = Math.min(1.5, Math.max(-0.15, Math.asin(offset.z / offset.length()) + up));
    offset.set(Math.cos(azimuth) * Math.cos(polar), Math.sin(azimuth) * Math.cos(polar), Math.sin(polar)).multiplyScalar(radius);
    this.#camera.position.copy(this.#controls.target).add(offset);
    this.#controls.update();
    this.ask();
  }

  paint(palette: Palette): void {
    this.#palette = palette;
    this.#trail.material.color.set(palette.accent);
    this.#path.material.color.set(palette.ghost);
    this.#ghostMaterial.color.set(palette.ghost);
    this.#payload.material.color.set(palette.warn);
    this.#sky.intensity = palette.dark ? 1.15 : 1.3;
    this.#sun.intensity = palette.dark ? 2.5 : 2.2;
    if (this.#model) this.setModel(this.#model);
    this.ask();
  }

  setModel(model: ArmModel): void {
    for (const old of [this.#body?.root, this.#ghost?.root, this.#floor]) this.#remove(old);
    const again = this.#model !== undefined && reach(this.#model) === reach(model);
    this.#model = model;
    const colors = this.#palette;
    this.#rings = model.joints.map(() => new MeshStandardMaterial({ color: colors.accent, roughness: 0.4, metalness: 0.1 }));
    this.#materials = {
      housing: new MeshStandardMaterial({ color: colors.body, roughness: 0.42, metalness: 0.08 }),
      link: new MeshStandardMaterial({ color: colors.link, roughness: 0.5, metalness: 0.05 }),
      cap: new MeshStandardMaterial({ color: colors.cap, roughness: 0.55, metalness: 0.1 }),
      metal: new MeshStandardMaterial({ color: colors.dark ? '#8d99a6' : '#6b7783', roughness: 0.35, metalness: 0.5 }),
      ring: (joint) => this.#rings[joint] as MeshStandardMaterial,
    };
    const ghost = { housing: this.#ghostMaterial, link: this.#ghostMaterial, metal: this.#ghostMaterial, cap: this.#ghostMaterial, ring: () => this.#ghostMaterial };
    this.#body = bodyOf(model, this.#materials);
    this.#ghost = bodyOf(model, ghost, true);
    this.#ghost.root.renderOrder = 2;
    this.#pose();
    this.#body.flange.add(this.#payload);
    this.#scene.add(this.#body.root, this.#ghost.root);
    this.#shadeLimits(model);
    this.#layFloor(model);
    const r = reach(model);
    if (this.#gravity) this.#scene.remove(this.#gravity);
    const down = new Vector3(...model.gravity_m_s2);
    if (down.length() > 0.1) {
      this.#gravity = new ArrowHelper(down.normalize(), new Vector3(-r * 0.3, -r * 0.3, r * 0.5), r * 0.24, colors.accent, r * 0.06, r * 0.035);
      this.#scene.add(this.#gravity);
    }
    this.#sun.position.set(r * 0.9, -r * 0.7, r * 2.2);
    const shadow = this.#sun.shadow.camera;
    Object.assign(shadow, { left: -r * 1.1, right: r * 1.1, top: r * 1.1, bottom: -r * 1.1, near: r * 0.4, far: r * 4.5 });
    shadow.updateProjectionMatrix();
    if (!again) this.view('home');
    this.#dress();
    this.ask();
  }

  /** Rotates the joints of the arm and of the ghost to the known positions. */
  #pose(): void {
    this.#body?.joints.forEach((joint, i) => (joint.rotation.z = this.#q[i] ?? 0));
    if (!this.#ghost) return;
    this.#ghost.joints.forEach((joint, i) => (joint.rotation.z = this.#ghostQ[i] ?? 0));
    this.#ghost.root.visible = this.#ghostShown;
  }

  /**
   * Sets the measured positions. Undefined: the positions are unknown, and the scene draws the arm faint in its last
   * pose.
   */
  setMeasured(q: readonly number[] | undefined): void {
    if ((q === undefined) !== this.#lost) {
      this.#lost = q === undefined;
      this.#dress();
    }
    if (!q || !this.#body || !this.#model) {
      if (q) this.#q = [...q];
      return;
    }
    const same = this.#q.length === q.length && q.every((value, i) => Math.abs(value - (this.#q[i] ?? NaN)) < 2e-5);
    if (same && this.#trailPoints.length > 0) return;
    this.#q = [...q];
    this.#pose();
    const frames = forward(this.#model, q);
    const tip = frames.at(-1);
    if (tip) this.#leave(place(tip));
    this.#dress();
    this.ask();
  }

  /**
   * Sets the ghost, which shows the target pose. The scene draws the ghost if its pose differs from the current pose.
   */
  setGhost(q: readonly number[] | undefined, always = false): void {
    const apart = q?.some((value, i) => Math.abs(value - (this.#q[i] ?? value)) > APART_RAD) ?? false;
    const visible = q !== undefined && (apart || always);
    if (!visible && !this.#ghostShown) return;
    this.#ghostShown = visible;
    if (q) this.#ghostQ = [...q];
    this.#pose();
    this.ask();
  }

  setShown(shown: Shown): void {
    this.#shown = { ...shown };
    this.#dress();
    this.ask();
  }

  setPointed(joint: number | undefined): void {
    this.#pointed = joint;
    this.#dress();
    this.ask();
  }

  /** Sets the path of the flange, and the positions of problems on the path. */
  setPath(points: readonly Vector[] | undefined, places: readonly { at: Vector; warning: boolean }[] = []): void {
    this.#path.geometry.dispose();
    this.#path.geometry = new BufferGeometry().setFromPoints((points ?? []).map((point) => new Vector3(...point)));
    if (points && points.length > 1) this.#path.computeLineDistances();
    this.#marks.clear();
    for (const { at, warning } of places) {
      const mark = new Mesh(new SphereGeometry(0.022, 20, 14), new MeshBasicMaterial({ color: warning ? this.#palette.warn : this.#palette.error }));
      mark.position.set(...at);
      this.#marks.add(mark);
    }
    this.#dress();
    this.ask();
  }

  setPayload(mass_kg: number, com_m: readonly number[]): void {
    this.#payload.visible = mass_kg > 0;
    // The drawn size of the payload is that of a ball with the payload's mass and a density of 2.7
    // kg per litre.
    this.#payload.scale.setScalar(Math.cbrt((3 * Math.max(mass_kg, 1e-3)) / (4 * Math.PI * 2700)));
    this.#payload.position.set(com_m[0] ?? 0, com_m[1] ?? 0, com_m[2] ?? 0);
    this.ask();
  }

  clearTrail(): void {
    this.#trailPoints = [];
    this.#leaveTrail();
    this.ask();
  }

  /** For tests: joint angles of the drawn bodies, rad, and the centre of the payload in the frame of the base, m. */
  get posed(): { measured: number[]; ghost: number[]; ghostShown: boolean; lost: boolean; payload: Vector } {
    const angles = (body: Body | undefined) => body?.joints.map((joint) => joint.rotation.z) ?? [];
    const payload = this.#payload.getWorldPosition(new Vector3()).toArray() as Vector;
    return { measured: angles(this.#body), ghost: angles(this.#ghost), ghostShown: this.#ghost?.root.visible ?? false, lost: this.#lost, payload };
  }

  dispose(): void {
    this.#controls.dispose();
    this.#renderer.dispose();
  }

  #leave(tip: Vector): void {
    const last = this.#trailPoints.at(-1);
    if (last && Math.hypot(tip[0] - last[0], tip[1] - last[1], tip[2] - last[2]) < 0.0015) return;
    this.#trailPoints.push(tip);
    if (this.#trailPoints.length > TRAIL) this.#trailPoints.shift();
    this.#leaveTrail();
  }

  #leaveTrail(): void {
    this.#trail.geometry.dispose();
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute(this.#trailPoints.flat(), 3));
    this.#trail.geometry = geometry;
  }

  #remove(object: Object3D | undefined): void {
    if (!object) return;
    this.#scene.remove(object);
    object.traverse((each) => {
      if (each instanceof Mesh && each !== this.#payload) (each.geometry as BufferGeometry).dispose();
    });
  }

  #layFloor(model: ArmModel): void {
    const size = Math.ceil(reach(model) * 1.25 * 5) / 5;
    const floor = new Group();
    const grid = new GridHelper(2 * size, Math.round(2 * size * 5), this.#palette.ink, this.#palette.line);
    grid.rotateX(Math.PI / 2);
    const lines = grid.material as LineBasicMaterial;
    lines.transparent = true;
    lines.opacity = this.#palette.dark ? 0.42 : 0.55;
    const shade = new Mesh(new CircleGeometry(size * 1.3, 64), new ShadowMaterial({ opacity: this.#palette.dark ? 0.5 : 0.2 }));
    shade.position.z = -0.001;
    shade.receiveShadow = true;
    floor.add(grid, shade);
    this.#floor = floor;
    this.#scene.add(floor);
  }

  /** Draws the range of each joint as a sector about the joint's axis, with a needle at the position of the joint. */
  #shadeLimits(model: ArmModel): void {
    this.#limits = [];
    this.#needles = [];
    model.joints.forEach((joint, i) => {
      const mount = this.#body?.mounts[i];
      if (!mount) return;
      const next = model.joints[i + 1]?.origin_xyz_m ?? [1, 0, 0];
      // The sector is centred on the direction of the link at zero.
      const zero = Math.hypot(next[0], next[1]) > 0.02 ? Math.atan2(next[1], next[0]) : 0;
      const r = housingRadius(joint.torque_max_nm);
      const [inner, outer] = [r * 1.35, r * 2.5];
      const group = new Group();
      const range = joint.position_max_rad - joint.position_min_rad;
      const material = () => new MeshBasicMaterial({ color: this.#palette.accent, transparent: true, opacity: 0.26, side: DoubleSide, depthWrite: false });
      group.add(new Mesh(new RingGeometry(inner, outer, 64, 1, zero + joint.position_min_rad, range), material()));
      const end = new MeshBasicMaterial({ color: this.#palette.error, transparent: true, opacity: 0.85, side: DoubleSide });
      const width = 0.035;
      for (const at of [joint.position_min_rad, joint.position_max_rad - width]) {
        group.add(new Mesh(new RingGeometry(inner, outer, 2, 1, zero + at, width), end));
      }
      const needle = new Mesh(new RingGeometry(inner * 0.96, outer * 1.06, 2, 1, zero - 0.025, 0.05), new MeshBasicMaterial({ color: this.#palette.ink, side: DoubleSide }));
      group.add(needle);
      group.visible = false;
      mount.add(group);
      this.#limits.push(group);
      this.#needles.push(needle);
    });
  }

  /** Sets colours and visibility according to the pose of the arm. */
  #dress(): void {
    const model = this.#model;
    if (!model) return;
    if (this.#gravity) this.#gravity.visible = this.#shown.all;
    this.#trail.visible = this.#shown.trail;
    this.#path.visible = this.#marks.visible = this.#shown.path;
    const bright = this.#materials;
    for (const material of [bright?.housing, bright?.link, bright?.metal, bright?.cap]) {
      if (!material) continue;
      material.transparent = this.#lost;
      material.opacity = this.#lost ? 0.25 : 1;
      material.needsUpdate = true;
    }
    model.joints.forEach((joint, i) => {
      const q = this.#q[i] ?? 0;
      const share = room(joint, q);
      const near = share < NEAR;
      const ring = this.#rings[i];
      ring?.color.set(new Color(this.#lost ? this.#palette.line : share < 0.02 ? this.#palette.error : near ? this.#palette.warn : this.#palette.accent));
      if (ring) ring.emissive.set(this.#pointed === i + 1 ? this.#palette.accent : '#000000');
      const group = this.#limits[i];
      if (group) group.visible = this.#shown.limits && !this.#lost && (near || this.#shown.all || this.#pointed === i + 1);
      const needle = this.#needles[i];
      if (needle) needle.rotation.z = q;
    });
  }
}
