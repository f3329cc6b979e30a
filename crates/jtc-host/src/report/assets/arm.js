// Drawing of the arm. The forward kinematics use the joint origins, and the user can turn the camera.
"use strict";

const Arm = (() => {
  const multiply = (a, b) => {
    const m = new Array(12);
    for (let r = 0; r < 3; r++) {
      for (let c = 0; c < 4; c++) {
        m[r * 4 + c] = a[r * 4] * b[c] + a[r * 4 + 1] * b[4 + c] + a[r * 4 + 2] * b[8 + c] + (c === 3 ? a[r * 4 + 3] : 0);
      }
    }
    return m;
  };
  // x, y, z, roll, pitch, yaw as in URDF: Trans · Rz(yaw) · Ry(pitch) · Rx(roll).
  const origin = ([x, y, z, roll, pitch, yaw]) => {
    const [cr, sr, cp, sp, cy, sy] = [roll, pitch, yaw].flatMap((v) => [Math.cos(v), Math.sin(v)]);
    return [
      cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x,
      sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y,
      -sp, cp * sr, cp * cr, z,
    ];
  };
  const turn = (q) => [Math.cos(q), -Math.sin(q), 0, 0, Math.sin(q), Math.cos(q), 0, 0, 0, 0, 1, 0];

  // Returns the positions of the base, the six joints and the flange, m.
  const chain = (origins, flange) => {
    const fixed = origins.map(origin);
    const last = origin(flange);
    return (q) => {
      let m = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
      const points = [[0, 0, 0]];
      for (let j = 0; j < 6; j++) {
        m = multiply(multiply(m, fixed[j]), turn(q[j] || 0));
        points.push([m[3], m[7], m[11]]);
      }
      m = multiply(m, last);
      points.push([m[3], m[7], m[11]]);
      return points;
    };
  };

  class View {
    constructor(canvas, forward, path, extent, colour) {
      Object.assign(this, { canvas, forward, path, extent, colour, azimuth: -0.85, elevation: 0.36, pose: null, share: 0 });
      let from = null;
      canvas.addEventListener("pointerdown", (e) => {
        from = [e.clientX, e.clientY, this.azimuth, this.elevation];
        canvas.setPointerCapture(e.pointerId);
      });
      canvas.addEventListener("pointermove", (e) => {
        if (!from) return;
        this.azimuth = from[2] + (e.clientX - from[0]) * 0.009;
        this.elevation = Math.max(-0.2, Math.min(1.45, from[3] + (e.clientY - from[1]) * 0.007));
        this.draw();
      });
      canvas.addEventListener("pointerup", () => { from = null; });
    }

    // Returns the position on the canvas of a point in space.
    project([x, y, z]) {
      const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
      const right = x * ca - y * sa;
      const away = x * sa + y * ca;
      const k = this.scale;
      return [this.w / 2 + right * k, this.ground - (z * ce + away * se) * k];
    }

    line(points, style, width, alpha = 1) {
      const c = this.context;
      c.globalAlpha = alpha;
      c.strokeStyle = style;
      c.lineWidth = width;
      c.beginPath();
      points.forEach((p, i) => (i ? c.lineTo(...p) : c.moveTo(...p)));
      c.stroke();
      c.globalAlpha = 1;
    }

    draw() {
      const ratio = window.devicePixelRatio || 1;
      const { clientWidth: w, clientHeight: h } = this.canvas;
      if (!w || !this.pose) return;
      this.canvas.width = w * ratio;
      this.canvas.height = h * ratio;
      const c = (this.context = this.canvas.getContext("2d"));
      c.scale(ratio, ratio);
      c.lineCap = c.lineJoin = "round";
      const { across, up } = this.extent;
      this.reach = Math.max(across, up / 2);
      this.scale = Math.min((w * 0.47) / this.reach, (h * 0.92) / (up * 0.95 + this.reach * 0.72));
      Object.assign(this, { w, h, ground: h - this.reach * 0.37 * this.scale - 8 });
      const { colour } = this;

      // Floor with a cross, and with rings at each quarter of the arm's reach.
      for (let ring = 1; ring <= 4; ring++) {
        const r = (this.reach * ring) / 4;
        const circle = Array.from({ length: 73 }, (_, i) => this.project([r * Math.cos((i * Math.PI) / 36), r * Math.sin((i * Math.PI) / 36), 0]));
        this.line(circle, colour("--line"), 1);
      }
      this.line([this.project([-this.reach, 0, 0]), this.project([this.reach, 0, 0])], colour("--line"), 1);
      this.line([this.project([0, -this.reach, 0]), this.project([0, this.reach, 0])], colour("--line"), 1);

      // Path of the flange: the past part has a strong colour, and the future part has a faint colour.
      const path = this.path.map((p) => this.project(p));
      const here = Math.max(1, Math.round(this.share * (path.length - 1)));
      this.line(path, colour("--accent"), 1.5, 0.28);
      this.line(path.slice(0, here + 1), colour("--accent"), 2.2, 0.9);

      // Shadow of the arm, links and joints.
      const points = this.forward(this.pose);
      this.line(points.map(([x, y]) => this.project([x, y, 0])), colour("--ink"), 9, 0.07);
      const screen = points.map((p) => this.project(p));
      this.line(screen, colour("--ink"), 11);
      this.line(screen, colour("--card"), 7.5);
      screen.slice(1, 7).forEach(([x, y], j) => {
        c.beginPath();
        c.arc(x, y, 7.5 - j * 0.5, 0, 7);
        c.fillStyle = colour(`--j${j}`);
        c.fill();
        c.lineWidth = 2;
        c.strokeStyle = colour("--card");
        c.stroke();
      });
      const [fx, fy] = screen[7];
      c.beginPath();
      c.arc(fx, fy, 3.2, 0, 7);
      c.fillStyle = colour("--ink");
      c.fill();
    }
  }
  return { chain, View };
})();
