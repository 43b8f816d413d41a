// The floor from above: map, sensors, paths, trails and the robot, in metres with y upwards.
import { address } from "/view-static/address.js";
import { cursor } from "/view-static/cursor.js";
import { live } from "/view-static/live.js";
import { sampleAt } from "/view-static/live_signals.js";
import { rowAt } from "/view-static/plot_paint.js";

const BODY_M = 0.17, WHEEL_M = [0.127, 0.035], TRACK_M = 0.283;
const LEFT = "#ffb454", RIGHT = "#5ccfe6", ROBOT = "#e6edf5";

export default {
  template: `<div class="top-view"><canvas tabindex="0" role="img" :aria-label="label"></canvas>
    <div class="top-view-readout" aria-hidden="true"></div></div>`,
  props: { label: String, mode: String, tool: String, follow: Boolean, sensors: Boolean, grid: String,
           odometry: Boolean, brush: Number, scale: Number, paths: Array, nodes: Array, pose: Array, fitted: Boolean,
           kept: Boolean, view: Array, driven: Boolean },
  mounted() {
    this.canvas = this.$el.querySelector("canvas");
    this.readout = this.$el.querySelector(".top-view-readout");
    this.centre = [0, 0]; this.zoom = this.scale || 100; this.images = {}; this.travel = [0, 0];
    this.stroke = null; this.pointers = new Map(); this.dirty = true; this.playing = null; this.lastSample = null;
    this.draw = () => { this.update(); this.paint(); };
    live.views.add(this.draw);
    this.pointed = () => this.paint();
    cursor.views.add(this.pointed);
    this.observer = new ResizeObserver(() => { if (this.fitted && !this.touched) this.fit(); this.paint(); });
    this.observer.observe(this.$el);
    const on = (name, handler) => this.canvas.addEventListener(name, handler, { passive: false });
    on("wheel", (e) => { e.preventDefault(); this.zoomAt(e, Math.exp(-e.deltaY * 0.0015)); });
    on("pointerdown", (e) => this.down(e)); on("pointermove", (e) => this.move(e));
    on("pointerup", (e) => this.up(e)); on("pointercancel", (e) => this.up(e));
    on("dblclick", (e) => { e.preventDefault(); this.$emit("finish", {}); });
    on("keydown", (e) => this.key(e));
    this.canvas.topView = this;
    if (this.view) { this.centre = this.view.slice(0, 2); this.zoom = this.view[2]; this.touched = true; }
    else if (this.fitted) this.fit();
    this.paint();
  },
  unmounted() { live.views.delete(this.draw); cursor.views.delete(this.pointed); this.observer.disconnect(); cancelAnimationFrame(this.playing?.frame); },
  watch: {
    paths() { if (this.fitted && !this.touched) this.fit(); this.paint(); }, nodes() { this.paint(); }, pose() { this.paint(); },
    grid() { this.paint(); }, sensors() { this.paint(); }, tool() { this.paint(); },
  },
  methods: {
    // ---- view
    keep() { if (this.kept) address.later({ v: this.touched ? [...this.centre, this.zoom].map((n) => Number(n.toFixed(3))).join(",") : "" }); },
    toScreen(x, y) { return [this.w / 2 + (x - this.centre[0]) * this.zoom, this.h / 2 - (y - this.centre[1]) * this.zoom]; },
    toWorld(px, py) { return [this.centre[0] + (px - this.w / 2) / this.zoom, this.centre[1] - (py - this.h / 2) / this.zoom]; },
    at(event) { const box = this.canvas.getBoundingClientRect(); return this.toWorld(event.clientX - box.left, event.clientY - box.top); },
    zoomAt(event, factor) {
      const before = this.at(event);
      this.zoom = Math.min(800, Math.max(8, this.zoom * factor)); this.touched = true;
      const after = this.at(event);
      this.centre = [this.centre[0] + before[0] - after[0], this.centre[1] + before[1] - after[1]];
      this.keep(); this.paint();
    },
    setZoom(factor) { this.zoom = factor ? Math.min(800, Math.max(8, this.zoom * factor)) : (this.scale || 100); this.touched = true; this.keep(); this.paint(); },
    fit() {
      const points = [];
      for (const path of this.paths || []) points.push(...path.points);
      if (this.mode !== "paths") {
        const world = live.state.frames?.world;
        if (world && !points.length) points.push([world[0], world[1]], [world[0] + world[2], world[1] + world[3]]);
        const robot = this.robotPose(); if (robot) points.push(robot);
      }
      if (!points.length || !this.canvas.clientWidth) return;
      const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
      const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
      this.centre = [(x0 + x1) / 2, (y0 + y1) / 2];
      const margin = 0.35;
      this.zoom = Math.min(this.mode === "paths" ? 400 : 200, this.canvas.clientWidth / (x1 - x0 + 2 * margin), this.canvas.clientHeight / (y1 - y0 + 2 * margin));
      if (this.touched) { this.touched = false; this.keep(); }
      this.paint();
    },
    robotPose() { return this.mode === "model" ? (this.playing?.pose || this.modelPose || this.pose) : this.mode === "paths" ? null : live.corrected; },
    // Called from Python for values that change too often for a property.
    setModel(pose, path) { this.modelPose = pose; if (path) this.modelPath = path; this.paint(); },
    play(poses, seconds) {
      cancelAnimationFrame(this.playing?.frame);
      const started = performance.now();
      const tick = (now) => {
        // The time of a frame may be before the call that requested it.
        const share = Math.min(1, Math.max(0, (now - started) / 1000 / seconds)), index = share * (poses.length - 1), k = Math.floor(index), f = index - k;
        const a = poses[k], b = poses[Math.min(k + 1, poses.length - 1)];
        this.playing.pose = a.map((v, i) => v + f * (b[i] - v));
        this.paint();
        if (share < 1) this.playing.frame = requestAnimationFrame(tick);
        else { this.modelPose = poses[poses.length - 1]; this.playing = null; this.$emit("played", {}); }
      };
      this.playing = { pose: poses[0], frame: requestAnimationFrame(tick) };
    },
    update() {
      const samples = live.samples, last = samples[samples.length - 1];
      if (this.driven) this.followRun();
      if (!last || this.mode !== "live") return;
      if (this.lastSample && last[0] > this.lastSample[0]) {
        const dt = Math.min(0.5, last[0] - this.lastSample[0]);
        this.travel[0] += last[1] * dt; this.travel[1] += last[2] * dt;
      }
      this.lastSample = last;
      if (this.follow && live.corrected && !this.pointers.size) {
        this.centre = [live.corrected[0], live.corrected[1]];
      }
    },
    followRun() { // what the robot has driven since its run began
      const drives = live.state.task?.stage === "driving";
      if (drives && !this.drives) this.drivenPath = [];
      this.drives = drives;
      const last = this.drivenPath?.at(-1), at = live.corrected;
      if (drives && at && (!last || Math.hypot(at[0] - last[0], at[1] - last[1]) > 0.01)) this.drivenPath.push([...at]);
    },
    image(name, version) {
      const known = this.images[name] || (this.images[name] = { version: null, picture: null });
      if (known.version !== version && !known.loading) {
        known.loading = true;
        const picture = new Image();
        picture.onload = () => {
          known.tinted = name === "world" ? tint(picture) : picture;
          known.picture = picture; known.version = version; known.loading = false; this.paint();
        };
        picture.onerror = () => { known.loading = false; };
        picture.src = `/maps/${name}.png?v=${version}`;
      }
      return known.tinted;
    },
    // ---- mouse, touch and keys
    down(event) {
      this.canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      const point = this.at(event), tool = this.tool || "pan";
      this.grabbed = null;
      if ((tool === "line" || tool === "arc") && event.button === 0) {
        const index = (this.nodes || []).findIndex((n) => Math.hypot(n[0] - point[0], n[1] - point[1]) * this.zoom < 12);
        if (index >= 0) { this.grabbed = index; this.grabbedFirst = true; return; }
        this.$emit("node", { x: point[0], y: point[1], kind: tool });
        return;
      }
      if (event.button === 0 && ["paint", "erase", "wall", "room", "place"].includes(tool) && this.pointers.size === 1) {
        this.stroke = { tool, points: [point] };
      }
      this.paint();
    },
    move(event) {
      const point = this.at(event);
      this.readout.textContent = `${point[0].toFixed(2)}, ${point[1].toFixed(2)} m`;
      this.cursor = point;
      const before = this.pointers.get(event.pointerId);
      if (!before) { if (this.tool && this.tool !== "pan") this.paint(); return; }
      if (this.grabbed !== null && this.grabbed !== undefined) {
        this.$emit("moved", { index: this.grabbed, x: point[0], y: point[1], first: this.grabbedFirst });
        this.grabbedFirst = false;
      } else if (this.stroke) {
        if (this.stroke.tool === "paint" || this.stroke.tool === "erase") {
          const last = this.stroke.points[this.stroke.points.length - 1];
          if (Math.hypot(point[0] - last[0], point[1] - last[1]) * this.zoom > 3) this.stroke.points.push(point);
        } else this.stroke.points[1] = point;
      } else if (this.pointers.size === 2) {
        const [a, b] = [...this.pointers.entries()].map(([id, p]) => id === event.pointerId ? [p, [event.clientX, event.clientY]] : [p, p]);
        const length = (i) => Math.hypot(a[i][0] - b[i][0], a[i][1] - b[i][1]);
        if (length(0) > 0) this.zoomAt(event, length(1) / length(0));
      } else {
        this.centre = [this.centre[0] - (event.clientX - before[0]) / this.zoom, this.centre[1] + (event.clientY - before[1]) / this.zoom];
        this.touched = true; this.keep();
      }
      this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
      this.paint();
    },
    up(event) {
      this.pointers.delete(event.pointerId);
      this.grabbed = null;
      const stroke = this.stroke;
      this.stroke = null;
      if (!stroke || event.type === "pointercancel") return;
      if (stroke.tool === "place") {
        const [a, b] = stroke.points;
        this.$emit("place", { x: a[0], y: a[1], theta: b ? Math.atan2(b[1] - a[1], b[0] - a[0]) : 0 });
      } else this.$emit("stroke", { tool: stroke.tool, points: stroke.points.slice(0, 1500) });
      this.paint();
    },
    key(event) {
      const step = 40 / this.zoom;
      const moves = { j: [-step, 0], l: [step, 0], i: [0, step], k: [0, -step] };
      if (moves[event.key]) { this.centre = [this.centre[0] + moves[event.key][0], this.centre[1] + moves[event.key][1]]; this.touched = true; this.keep(); }
      else if (event.key === "f") this.fit();
      else if (event.key === "0") this.setZoom(0);
      else if (event.key === "," ) this.setZoom(1 / 1.25);
      else if (event.key === ".") this.setZoom(1.25);
      else if (event.key === "Enter" && this.tool && this.tool !== "pan") this.keyTool();
      else return;
      event.preventDefault();
      this.paint();
    },
    keyTool() { // by keyboard a tool is applied at the centre of the view
      const c = this.centre;
      if (this.tool === "line" || this.tool === "arc") this.$emit("node", { x: c[0], y: c[1], kind: this.tool });
      else if (this.tool === "place") this.$emit("place", { x: c[0], y: c[1], theta: 0 });
      else if (this.tool === "paint" || this.tool === "erase") this.$emit("stroke", { tool: this.tool, points: [[...c]] });
      else if (this.mark) { this.$emit("stroke", { tool: this.tool, points: [this.mark, [...c]] }); this.mark = null; }
      else this.mark = [...c];
      this.paint();
    },
    // ---- drawing
    paint() {
      const canvas = this.canvas, ratio = window.devicePixelRatio || 1;
      this.w = canvas.clientWidth; this.h = canvas.clientHeight;
      if (!this.w || !this.h) return;
      if (canvas.width !== Math.round(this.w * ratio) || canvas.height !== Math.round(this.h * ratio)) {
        canvas.width = Math.round(this.w * ratio); canvas.height = Math.round(this.h * ratio);
      }
      const c = canvas.getContext("2d");
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      c.fillStyle = "#0b0e13"; c.fillRect(0, 0, this.w, this.h);
      const frames = live.state.frames;
      if (this.grid && this.grid !== "none" && frames) this.picture(c, this.image(this.grid, live.state.grids), frames.grid, 0.85);
      this.lines(c);
      if (this.mode !== "paths" && frames && (!this.grid || this.grid === "none" || this.mode === "world")) this.picture(c, this.image("world", live.state.world), frames.world, this.grid && this.grid !== "none" ? 0.45 : 1);
      if (this.mode !== "paths" && this.mode !== "model" && this.sensors && live.state.scan) this.beams(c, live.state.scan);
      if (this.mode === "live" || this.mode === "world") {
        this.polyline(c, live.truth, ROBOT, 1.6, []);
        if (this.odometry) this.polyline(c, live.trail, "#ff9e64", 1.4, [5, 4]);
      }
      for (const path of this.paths || []) this.path(c, path);
      if (this.modelPath) this.polyline(c, this.modelPath, "#7ee787", 2, []);
      if (this.drivenPath?.length) this.polyline(c, this.drivenPath, ROBOT, 2, []);
      this.drawNodes(c);
      if (this.stroke) this.preview(c);
      else if (this.cursor && (this.tool === "paint" || this.tool === "erase")) this.ring(c, this.cursor);
      if (this.mode !== "paths") {
        if (this.mode !== "model" && this.odometry && live.odometry) this.robot(c, live.odometry, true);
        const pose = this.robotPose();
        if (this.driven && live.corrected && (this.drives || this.drivenPath?.length)) this.robot(c, live.corrected, false);
        if (pose && !(this.driven && this.drives)) this.robot(c, pose, false);
      }
      this.pointedAt(c);
      if (this.tool && this.tool !== "pan" && document.activeElement === canvas) this.cross(c);
      this.scaleBar(c);
    },
    picture(c, picture, frame, alpha) {
      if (!picture || !frame) return;
      const [x, y] = this.toScreen(frame[0], frame[1] + frame[3]);
      c.imageSmoothingEnabled = false; c.globalAlpha = alpha;
      c.drawImage(picture, x, y, frame[2] * this.zoom, frame[3] * this.zoom);
      c.globalAlpha = 1;
    },
    lines(c) {
      const step = this.zoom > 180 ? 0.25 : this.zoom > 70 ? 0.5 : this.zoom > 30 ? 1 : 5;
      const [x0, y1] = this.toWorld(0, 0), [x1, y0] = this.toWorld(this.w, this.h);
      for (const [from, to, vertical] of [[x0, x1, true], [y0, y1, false]]) {
        for (let n = Math.ceil(from / step); n * step <= to; n += 1) {
          c.strokeStyle = n === 0 ? "#3a4656" : (n * step) % 1 === 0 ? "#1d242e" : "#141a22";
          c.lineWidth = 1;
          const [px, py] = this.toScreen(n * step, n * step);
          c.beginPath();
          if (vertical) { c.moveTo(Math.round(px) + 0.5, 0); c.lineTo(Math.round(px) + 0.5, this.h); }
          else { c.moveTo(0, Math.round(py) + 0.5); c.lineTo(this.w, Math.round(py) + 0.5); }
          c.stroke();
        }
      }
    },
    beams(c, scan) {
      const [x, y, theta] = scan.pose;
      const n = scan.sonar.length;
      for (let i = 0; i < n; i += 1) {
        const hit = scan.sonar[i] !== null, reach = (hit ? scan.sonar[i] / 1000 : 0) + scan.sonar_mount;
        if (!hit) continue;
        const angle = theta + i * 2 * Math.PI / n, half = scan.sonar_cone / 2, [px, py] = this.toScreen(x, y);
        c.beginPath(); c.moveTo(px, py);
        c.arc(px, py, reach * this.zoom, -angle - half, -angle + half); c.closePath();
        c.fillStyle = "rgba(92, 207, 230, 0.06)"; c.fill();
        c.beginPath(); c.arc(px, py, reach * this.zoom, -angle - half, -angle + half);
        c.strokeStyle = "rgba(92, 207, 230, 0.55)"; c.lineWidth = 1.5; c.stroke();
      }
      c.fillStyle = "#ff6b8b";
      scan.laser.forEach((mm, i) => {
        if (mm === null) return;
        const angle = theta + scan.laser_from + i * scan.laser_step;
        const [px, py] = this.toScreen(x + mm / 1000 * Math.cos(angle), y + mm / 1000 * Math.sin(angle));
        c.fillRect(px - 1.25, py - 1.25, 2.5, 2.5);
      });
    },
    polyline(c, points, colour, width, dash) {
      if (!points || points.length < 2) return;
      c.beginPath(); c.strokeStyle = colour; c.lineWidth = width; c.setLineDash(dash); c.lineJoin = "round";
      points.forEach((p, i) => { const [x, y] = this.toScreen(p[0], p[1]); if (i) c.lineTo(x, y); else c.moveTo(x, y); });
      c.stroke(); c.setLineDash([]);
    },
    path(c, path) {
      this.polyline(c, path.points, path.colour, path.width || 2, path.dash || []);
      const last = path.points[path.points.length - 1];
      if (!last || path.bare) return;
      const [x, y] = this.toScreen(last[0], last[1]);
      c.fillStyle = path.colour; c.strokeStyle = path.colour; c.lineWidth = 2;
      c.beginPath(); c.arc(x, y, 5, 0, 2 * Math.PI); c.fill();
      if (last.length > 2) { c.beginPath(); c.moveTo(x, y); c.lineTo(x + 16 * Math.cos(last[2]), y - 16 * Math.sin(last[2])); c.stroke(); }
      if (path.name) { c.font = "12px system-ui"; c.textAlign = "left"; c.fillText(path.name, x + 9, y - 8 + (path.shift || 0)); }
    },
    drawNodes(c) {
      for (const [i, node] of (this.nodes || []).entries()) {
        const [x, y] = this.toScreen(node[0], node[1]);
        c.fillStyle = node[2] === "arc" ? "#d2a8ff" : "#7ee787"; c.strokeStyle = "#0b0e13"; c.lineWidth = 2;
        c.beginPath();
        if (node[2] === "arc") c.arc(x, y, 6, 0, 2 * Math.PI); else c.rect(x - 5, y - 5, 10, 10);
        c.fill(); c.stroke();
        c.fillStyle = "#c9d3df"; c.font = "11px system-ui"; c.textAlign = "left"; c.fillText(String(i + 1), x + 9, y + 4);
      }
    },
    preview(c) {
      const { tool, points } = this.stroke, width = Math.max(2, (this.brush || 0.1) * this.zoom);
      c.strokeStyle = tool === "erase" ? "rgba(255, 107, 107, 0.5)" : "rgba(255, 180, 84, 0.7)";
      c.lineWidth = width; c.lineCap = "round"; c.lineJoin = "round";
      let line = points;
      if (points.length === 1) line = [points[0], points[0]];
      if (tool === "room" && points[1]) {
        const [[a, b], [d, e]] = points;
        line = [[a, b], [d, b], [d, e], [a, e], [a, b]];
      }
      if (tool === "place") c.lineWidth = 3;
      c.beginPath();
      line.forEach((p, i) => { const [x, y] = this.toScreen(...p); if (i) c.lineTo(x, y); else c.moveTo(x, y); });
      c.stroke(); c.lineCap = "butt";
    },
    ring(c, at) {
      const [x, y] = this.toScreen(...at);
      c.strokeStyle = "#94a1b2"; c.lineWidth = 1; c.beginPath();
      c.arc(x, y, Math.max(3, (this.brush || 0.1) * this.zoom / 2), 0, 2 * Math.PI); c.stroke();
    },
    cross(c) {
      const [x, y] = [this.w / 2, this.h / 2];
      c.strokeStyle = "#94a1b2"; c.lineWidth = 1; c.beginPath();
      c.moveTo(x - 8, y); c.lineTo(x + 8, y); c.moveTo(x, y - 8); c.lineTo(x, y + 8); c.stroke();
    },
    robot(c, pose, odometry) {
      const [x, y] = this.toScreen(pose[0], pose[1]), z = this.zoom;
      c.save();
      if (live.stale && this.mode !== "model") c.globalAlpha = 0.35;
      c.translate(x, y); c.rotate(-pose[2]);
      if (odometry) {
        c.strokeStyle = "#ff9e64"; c.setLineDash([4, 3]); c.lineWidth = 1.5;
        c.beginPath(); c.arc(0, 0, BODY_M * z, 0, 2 * Math.PI); c.moveTo(0, 0); c.lineTo(BODY_M * z, 0); c.stroke();
        c.restore();
        return;
      }
      c.beginPath(); c.arc(0, 0, BODY_M * z, 0, 2 * Math.PI);
      c.fillStyle = "rgba(38, 48, 62, 0.92)"; c.fill(); c.strokeStyle = ROBOT; c.lineWidth = 1.5; c.stroke();
      [1, -1].forEach((side, i) => {
        const w = WHEEL_M[0] * z, h = WHEEL_M[1] * z, top = -side * TRACK_M / 2 * z - h / 2;
        c.fillStyle = "#0b0e13"; c.fillRect(-w / 2, top, w, h);
        c.strokeStyle = i === 0 ? LEFT : RIGHT; c.lineWidth = 1.5; c.strokeRect(-w / 2, top, w, h);
        const pitch = 0.0254 * z, shift = ((this.travel[i] * z) % pitch + pitch) % pitch;
        c.beginPath();
        for (let at = -w / 2 + shift; at < w / 2; at += pitch) { c.moveTo(at, top + 1); c.lineTo(at, top + h - 1); }
        c.lineWidth = 1; c.stroke();
      });
      for (let i = 0; i < 16; i += 1) {
        const a = i * Math.PI / 8;
        c.fillStyle = "#5ccfe6"; c.fillRect(0.155 * z * Math.cos(a) - 1, 0.155 * z * Math.sin(a) - 1, 2, 2);
      }
      c.beginPath(); c.moveTo(0.13 * z, 0); c.lineTo(0.03 * z, 0.045 * z); c.lineTo(0.03 * z, -0.045 * z); c.closePath();
      c.fillStyle = ROBOT; c.fill();
      c.restore();
    },
    // The robot at the time of the plot's cursor, on every path that has times.
    pointedAt(c) {
      if (cursor.t === null) return;
      if (cursor.live) {
        const sample = this.mode === "live" ? sampleAt(cursor.t) : null;
        if (sample) this.outline(c, sample.slice(8, 11), "#ff9e64");
        return;
      }
      for (const path of this.paths || []) {
        if (path.t?.length) this.outline(c, path.points[rowAt(path.t, cursor.t)], path.colour);
      }
    },
    outline(c, pose, colour) {
      const [x, y] = this.toScreen(pose[0], pose[1]), r = Math.max(6, BODY_M * this.zoom);
      c.save(); c.translate(x, y); c.rotate(-(pose[2] || 0));
      c.strokeStyle = colour; c.lineWidth = 2;
      c.beginPath(); c.arc(0, 0, r, 0, 2 * Math.PI); c.moveTo(0, 0); c.lineTo(r, 0); c.stroke();
      c.restore();
    },
    scaleBar(c) {
      const metres = this.zoom > 180 ? 0.5 : this.zoom > 60 ? 1 : this.zoom > 25 ? 2 : 5, length = metres * this.zoom;
      c.strokeStyle = "#c9d3df"; c.lineWidth = 1.5; c.beginPath();
      c.moveTo(14, this.h - 20); c.lineTo(14, this.h - 14); c.lineTo(14 + length, this.h - 14); c.lineTo(14 + length, this.h - 20); c.stroke();
      c.fillStyle = "#c9d3df"; c.font = "11px system-ui"; c.textAlign = "left";
      c.fillText(`${metres} m · ${Math.round(this.zoom)} px/m`, 18, this.h - 20);
    },
  },
};

function tint(picture) { // occupied cells in one colour, the rest transparent
  const canvas = document.createElement("canvas");
  canvas.width = picture.width; canvas.height = picture.height;
  const c = canvas.getContext("2d");
  c.drawImage(picture, 0, 0);
  const data = c.getImageData(0, 0, canvas.width, canvas.height);
  for (let i = 0; i < data.data.length; i += 4) {
    const full = data.data[i] < 100;
    data.data[i] = 138; data.data[i + 1] = 150; data.data[i + 2] = 168; data.data[i + 3] = full ? 255 : 0;
  }
  c.putImageData(data, 0, 0);
  return canvas;
}
