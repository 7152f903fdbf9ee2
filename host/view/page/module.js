/* The module in 3-D: the tube that the table says at the measured pressures, and the tip where the sensor has it. Own drawing on a
 * canvas, orthographic, far to near. Lengths in mm, angles in rad, base frame: z along the straight module, x through chamber 1. */
"use strict";

const CHAMBER_COLOURS = ["#0072b2", "#d55e00", "#009e73"];
const RINGS = 26, SIDES = 36, CHAMBER_HALF = 0.62;

class ModuleScene {
  constructor(canvas, geometry) {
    this.canvas = canvas;
    this.geometry = geometry;
    this.turn = -0.65;
    this.tilt = 0.32;
    this.dragFrom = null;
    canvas.addEventListener("pointerdown", (e) => { this.dragFrom = e; canvas.setPointerCapture(e.pointerId); });
    canvas.addEventListener("pointerup", () => { this.dragFrom = null; });
    canvas.addEventListener("pointermove", (e) => this.drag(e));
  }

  drag(e) {
    if (!this.dragFrom) return;
    this.turn += (e.clientX - this.dragFrom.clientX) * 0.01;
    this.tilt = Math.max(-1.5, Math.min(1.5, this.tilt + (e.clientY - this.dragFrom.clientY) * 0.01));
    this.dragFrom = e;
    this.draw();
  }

  show(report) { this.report = report; this.draw(); }

  /* Frame at the length s from the base: centre, and the section's two axes and normal. */
  frameAt(s, shape) {
    const g = this.geometry, bend = shape.bend, length = g.chamber_length_mm * shape.stretch;
    const x = Math.cos(shape.direction), y = Math.sin(shape.direction);
    const along = Math.max(0, Math.min(length, s - g.cap_proximal_mm)), angle = bend * along / length;
    const across = bend < 1e-6 ? 0 : length / bend * (1 - Math.cos(angle));
    const up = bend < 1e-6 ? along : length / bend * Math.sin(angle);
    const rest = Math.max(0, s - g.cap_proximal_mm - length), start = Math.min(s, g.cap_proximal_mm);
    const c = Math.cos(angle), n = Math.sin(angle);
    return {
      centre: [x * (across + rest * n), y * (across + rest * n), start + up + rest * c],
      /* rotation by the angle about (-y, x, 0) */
      point: (u, v) => {
        const outward = u * x + v * y, side = -u * y + v * x;
        return [x * outward * c - y * side, y * outward * c + x * side, -outward * n];
      },
      normal: [x * n, y * n, c],
    };
  }

  project(p) {
    const a = Math.cos(this.turn), b = Math.sin(this.turn), c = Math.cos(this.tilt), d = Math.sin(this.tilt);
    const x = a * p[0] - b * p[1], depth = b * p[0] + a * p[1];
    return [this.middle + this.scale * x, this.floor - this.scale * (p[2] * c + depth * d), depth * c - p[2] * d];
  }

  /* Unit vector towards light and eye, for shading. */
  shade(normal) {
    const p = [Math.cos(this.turn), Math.sin(this.turn)];
    const toEye = -(p[1] * normal[0] + p[0] * normal[1]) * Math.cos(this.tilt) + normal[2] * Math.sin(this.tilt);
    const sideways = p[0] * normal[0] - p[1] * normal[1];
    return Math.max(0, Math.min(1, 0.62 + 0.3 * toEye - 0.22 * sideways + 0.12 * normal[2]));
  }

  draw() {
    if (!this.report) return;
    const box = this.canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(box.width * ratio)) this.canvas.width = Math.round(box.width * ratio);
    if (this.canvas.height !== Math.round(box.height * ratio)) this.canvas.height = Math.round(box.height * ratio);
    const context = this.canvas.getContext("2d");
    const g = this.geometry, reach = g.cap_proximal_mm + g.chamber_length_mm * 1.25 + g.cap_distal_mm;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, box.width, box.height);
    this.scale = Math.min((box.height - 90) / (reach + 8), (box.width - 40) / (2 * reach * 0.62));
    this.middle = box.width / 2;
    this.floor = box.height - 74;
    this.drawGround(context, reach);
    this.drawAxes(context);
    this.drawTube(context);
    this.drawTip(context);
  }

  drawGround(context, reach) {
    context.strokeStyle = "#e3e8ed";
    context.lineWidth = 1;
    for (let r = 20; r <= 0.62 * reach; r += 20) {
      context.beginPath();
      for (let k = 0; k <= 72; k++) {
        const q = this.project([r * Math.cos(k * Math.PI / 36), r * Math.sin(k * Math.PI / 36), 0]);
        if (k) context.lineTo(q[0], q[1]); else context.moveTo(q[0], q[1]);
      }
      context.stroke();
    }
  }

  line(context, from, to, style, width, dash) {
    const a = this.project(from), b = this.project(to);
    context.strokeStyle = style;
    context.lineWidth = width;
    context.setLineDash(dash || []);
    context.beginPath();
    context.moveTo(a[0], a[1]);
    context.lineTo(b[0], b[1]);
    context.stroke();
    context.setLineDash([]);
  }

  label(context, at, text, style) {
    const q = this.project(at);
    context.fillStyle = style;
    context.font = "600 12px system-ui, 'DejaVu Sans', sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillText(text, q[0], q[1]);
  }

  drawAxes(context) {
    const r = 1.7 * this.geometry.outer_diameter_mm;
    this.line(context, [0, 0, 0], [r, 0, 0], "#98a5b1", 1.5);
    this.line(context, [0, 0, 0], [0, r, 0], "#98a5b1", 1.5);
    this.label(context, [r + 4, 0, 0], "x", "#5c6b7a");
    this.label(context, [0, r + 4, 0], "y", "#5c6b7a");
    const command = this.report.command;
    if (command && command.bend_deg > 0) {
      const a = command.direction_deg * Math.PI / 180, far = 2.1 * this.geometry.outer_diameter_mm;
      this.line(context, [0, 0, 0], [far * Math.cos(a), far * Math.sin(a), 0], "#b0489b", 2.5, [7, 5]);
    }
  }

  /* The chamber whose wall is at this angle of the section, or none. */
  chamberAt(angle) {
    for (let c = 0; c < 3; c++) {
      const off = Math.atan2(Math.sin(angle - c * 2 * Math.PI / 3), Math.cos(angle - c * 2 * Math.PI / 3));
      if (Math.abs(off) < CHAMBER_HALF) return c;
    }
    return -1;
  }

  colourAt(angle, inChambers, light) {
    const rubber = [214, 205, 192], cap = [150, 160, 170];
    let base = inChambers ? rubber : cap;
    const c = inChambers ? this.chamberAt(angle) : -1;
    if (c >= 0) {
      const hex = CHAMBER_COLOURS[c], share = 0.16 + 0.84 * Math.min(1, this.report.pressure_kpa[c] / this.geometry.working_pressure_kpa);
      base = base.map((v, i) => v + (parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16) - v) * share);
    }
    return "rgb(" + base.map((v) => Math.round(v * (0.45 + 0.62 * light))).join(",") + ")";
  }

  drawTube(context) {
    const g = this.geometry, s = this.report.shape;
    const shape = { bend: s.bend_deg * Math.PI / 180, direction: s.direction_deg * Math.PI / 180, stretch: s.stretch };
    const active = g.chamber_length_mm * shape.stretch, total = g.cap_proximal_mm + active + g.cap_distal_mm;
    const at = [0, g.cap_proximal_mm];
    for (let i = 1; i <= RINGS; i++) at.push(g.cap_proximal_mm + active * i / RINGS);
    at.push(total);
    const radius = g.outer_diameter_mm / 2;
    const rings = at.map((length) => {
      const frame = this.frameAt(length, shape), points = [], normals = [];
      for (let k = 0; k < SIDES; k++) {
        const a = 2 * Math.PI * k / SIDES;
        const out = frame.point(Math.cos(a), Math.sin(a));
        normals.push(out);
        points.push(frame.centre.map((v, i) => v + radius * out[i]));
      }
      return { points, normals, frame };
    });
    const faces = [];
    for (let i = 0; i + 1 < rings.length; i++) {
      for (let k = 0; k < SIDES; k++) {
        const n = (k + 1) % SIDES;
        const corner = [rings[i].points[k], rings[i].points[n], rings[i + 1].points[n], rings[i + 1].points[k]].map((p) => this.project(p));
        const light = this.shade(rings[i].normals[k]);
        faces.push({ corner, depth: corner[0][2] + corner[1][2] + corner[2][2] + corner[3][2],
          colour: this.colourAt(2 * Math.PI * (k + 0.5) / SIDES, i > 0 && i + 2 < rings.length, light) });
      }
    }
    const end = rings[rings.length - 1];
    const lid = end.points.map((p) => this.project(p));
    faces.push({ corner: lid, depth: 4 * lid.reduce((sum, p) => sum + p[2], 0) / lid.length - 0.5,
      colour: this.colourAt(0, false, this.shade(end.frame.normal)) });
    faces.sort((a, b) => b.depth - a.depth);
    for (const face of faces) {
      context.fillStyle = context.strokeStyle = face.colour;
      context.lineWidth = 0.7;
      context.beginPath();
      face.corner.forEach((q, i) => (i ? context.lineTo(q[0], q[1]) : context.moveTo(q[0], q[1])));
      context.closePath();
      context.fill();
      context.stroke();
    }
  }

  drawTip(context) {
    if (!this.report.measured) return;
    const [w, x, y, z] = this.report.tip_quaternion, tip = this.report.tip_mm;
    const axis = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)];
    this.line(context, tip, tip.map((v, i) => v + 12 * axis[i]), "#1d2733", 2.5);
    const q = this.project(tip);
    context.fillStyle = "#fff";
    context.strokeStyle = "#1d2733";
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(q[0], q[1], 5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }
}
