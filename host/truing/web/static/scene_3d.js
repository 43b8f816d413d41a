// The world and the robot in three dimensions: walls from the map, laser points, trail; orbit, follow or top camera.
import { live } from "/view-static/live.js";

const BODY_M = 0.17, BODY_HEIGHT_M = 0.16, WHEEL_M = 0.0635, WHEEL_WIDTH_M = 0.035, TRACK_M = 0.283, WALL_M = 0.45;
const LEFT = 0xffb454, RIGHT = 0x5ccfe6;

export default {
  template: `<div class="scene-3d"><canvas tabindex="0" role="img" :aria-label="label"></canvas><p class="scene-message" role="status">{{ message }}</p></div>`,
  props: { label: String, camera: String, sensors: Boolean },
  data: () => ({ message: "" }),
  async mounted() {
    const { THREE, OrbitControls } = await import("nicegui-scene");
    const canvas = this.$el.querySelector("canvas");
    this.three = THREE;
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    } catch (error) {
      this.message = "This browser has no WebGL, so 3-D is not available; the Live page shows the same from above.";
      return;
    }
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0x0b0e13);
    this.scene.fog = new THREE.Fog(0x0b0e13, 12, 40);
    this.scene.add(new THREE.HemisphereLight(0xdbe3ec, 0x1b222c, 1.6));
    const sun = new THREE.DirectionalLight(0xffffff, 1.4);
    sun.position.set(4, -6, 9);
    this.scene.add(sun);
    this.scene.add(this.floor(15), this.floor(15, 0.5));
    this.viewpoint = new THREE.PerspectiveCamera(50, 1, 0.02, 200);
    this.viewpoint.up.set(0, 0, 1);
    this.viewpoint.position.set(-3.2, -4.2, 3.4);
    this.controls = new OrbitControls(this.viewpoint, canvas);
    this.controls.maxPolarAngle = Math.PI / 2 - 0.02;
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => { this.dirty = true; });
    this.robot = this.makeRobot();
    this.scene.add(this.robot);
    this.points = this.cloud(0xff6b8b, 720, 0.035);
    this.trail = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xe6edf5 }));
    this.trail.frustumCulled = false;
    this.scene.add(this.points, this.trail);
    this.travel = [0, 0];
    this.drawn = 0;
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.scene3d = this;
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(this.$el);
    this.resize();
    this.draw = () => this.paint();
    live.views.add(this.draw);
  },
  unmounted() {
    if (this.draw) live.views.delete(this.draw);
    this.watch?.disconnect();
    this.controls?.dispose();
    this.renderer?.dispose();
    this.renderer?.forceContextLoss();
  },
  watch: { camera() { if (this.camera === "orbit" && this.controls) this.controls.enabled = true; } },
  methods: {
    // Grid lines one metre apart, optionally offset. In segments of one metre: software renderers drop a line
    // whose end is behind the camera.
    floor(half, offset = 0) {
      const THREE = this.three, ends = [];
      for (let a = -half; a < half + 0.5; a += 1) for (let b = -half; b < half; b += 1) {
        ends.push(a + offset, b, 0, a + offset, b + 1, 0, b, a + offset, 0, b + 1, a + offset, 0);
      }
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.Float32BufferAttribute(ends, 3));
      return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: offset ? 0x1d2630 : 0x36424f }));
    },
    makeRobot() {
      const THREE = this.three, robot = new THREE.Group();
      const part = (geometry, colour, x, y, z) => {
        const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color: colour, roughness: 0.6, metalness: 0.15 }));
        mesh.position.set(x, y, z);
        robot.add(mesh);
        return mesh;
      };
      const body = part(new THREE.CylinderGeometry(BODY_M, BODY_M, BODY_HEIGHT_M, 48), 0x4a5a70, 0, 0, 0.04 + BODY_HEIGHT_M / 2);
      body.rotation.x = Math.PI / 2;
      this.wheels = [[1, LEFT], [-1, RIGHT]].map(([side, colour]) => {
        const wheel = part(new THREE.CylinderGeometry(WHEEL_M, WHEEL_M, WHEEL_WIDTH_M, 24), 0x11151b, 0, side * (TRACK_M / 2 + 0.03), WHEEL_M);
        const spoke = new THREE.Mesh(new THREE.BoxGeometry(1.9 * WHEEL_M, WHEEL_WIDTH_M + 0.004, 0.014), new THREE.MeshStandardMaterial({ color: colour }));
        wheel.add(spoke);
        return wheel;
      });
      const nose = part(new THREE.ConeGeometry(0.045, 0.1, 3), 0xe6edf5, 0.06, 0, 0.05 + BODY_HEIGHT_M);
      nose.rotation.z = -Math.PI / 2;
      nose.scale.z = 0.25;
      for (let i = 0; i < 16; i += 1) {
        const a = i * Math.PI / 8;
        part(new THREE.SphereGeometry(0.012, 8, 6), RIGHT, BODY_M * Math.cos(a), BODY_M * Math.sin(a), 0.15);
      }
      return robot;
    },
    cloud(colour, count, size) {
      const THREE = this.three, geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
      geometry.setDrawRange(0, 0);
      const points = new THREE.Points(geometry, new THREE.PointsMaterial({ color: colour, size }));
      points.frustumCulled = false;
      return points;
    },
    resize() {
      const width = this.$el.clientWidth, height = this.$el.clientHeight;
      if (!width || !height) return;
      this.renderer.setSize(width, height, false);
      this.viewpoint.aspect = width / height;
      this.viewpoint.updateProjectionMatrix();
      this.dirty = true;
    },
    walls() { // the map's occupied cells as boxes, merged along rows and over equal rows
      const frame = live.state.frames?.world, version = live.state.world;
      if (!frame || this.version === version || this.loading) return;
      this.loading = true;
      const picture = new Image();
      picture.onload = () => {
        this.loading = false; this.version = version;
        const canvas = document.createElement("canvas");
        canvas.width = picture.width; canvas.height = picture.height;
        const context = canvas.getContext("2d");
        context.drawImage(picture, 0, 0);
        this.build(context.getImageData(0, 0, picture.width, picture.height), frame);
      };
      picture.onerror = () => { this.loading = false; };
      picture.src = `/maps/world.png?v=${version}`;
    },
    build(image, frame) {
      const THREE = this.three, cell = frame[2] / image.width, open = new Map(), boxes = [];
      for (let row = 0; row <= image.height; row += 1) {
        const runs = new Set();
        for (let x = 0, from = -1; row < image.height && x <= image.width; x += 1) {
          const full = x < image.width && image.data[4 * (row * image.width + x)] < 100;
          if (full && from < 0) from = x;
          if (!full && from >= 0) { runs.add(`${from},${x}`); from = -1; }
        }
        for (const [run, first] of open) if (!runs.has(run)) { boxes.push([...run.split(",").map(Number), first, row]); open.delete(run); }
        for (const run of runs) if (!open.has(run)) open.set(run, row);
      }
      if (this.blocks) { this.scene.remove(this.blocks); this.blocks.geometry.dispose(); this.blocks.material.dispose(); }
      this.blocks = new THREE.InstancedMesh(new THREE.BoxGeometry(1, 1, 1), new THREE.MeshStandardMaterial({ color: 0x8a96a8, roughness: 0.9 }), boxes.length);
      this.blocks.frustumCulled = false;
      const place = new THREE.Matrix4();
      boxes.forEach(([x0, x1, y0, y1], i) => {
        const w = (x1 - x0) * cell, h = (y1 - y0) * cell;
        place.makeScale(w, h, WALL_M).setPosition(frame[0] + x0 * cell + w / 2, frame[1] + frame[3] - y0 * cell - h / 2, WALL_M / 2);
        this.blocks.setMatrixAt(i, place);
      });
      this.scene.add(this.blocks);
      this.dirty = true;
    },
    paint() {
      if (!this.$el.clientWidth) return;
      this.walls();
      const pose = live.corrected, last = live.samples[live.samples.length - 1];
      if (pose) {
        const [x, y, theta] = pose;
        this.robot.position.set(x, y, 0);
        this.robot.rotation.z = theta;
        if (last && this.lastSample && last[0] > this.lastSample[0]) {
          const dt = Math.min(0.5, last[0] - this.lastSample[0]);
          this.wheels.forEach((wheel, i) => { this.travel[i] += last[1 + i] * dt; wheel.rotation.y = this.travel[i] / WHEEL_M; });
        }
        this.lastSample = last;
        this.placeCamera(x, y, theta);
      }
      this.laser(live.state.scan);
      if (live.truth.length > 1 && live.truth.length !== this.trailLength) {
        this.trailLength = live.truth.length;
        this.trail.geometry.dispose();
        this.trail.geometry = new this.three.BufferGeometry().setFromPoints(live.truth.map((p) => new this.three.Vector3(p[0], p[1], 0.006)));
      }
      this.renderer.render(this.scene, this.viewpoint);
      this.drawn += 1;
    },
    placeCamera(x, y, theta) {
      const THREE = this.three;
      if (this.camera === "follow") {
        this.controls.enabled = false;
        const target = new THREE.Vector3(x - 1.7 * Math.cos(theta), y - 1.7 * Math.sin(theta), 1.05);
        this.viewpoint.position.lerp(target, 0.12);
        this.viewpoint.lookAt(x + 0.5 * Math.cos(theta), y + 0.5 * Math.sin(theta), 0.1);
        this.controls.target.set(x, y, 0.1);
      } else if (this.camera === "top") {
        this.controls.enabled = false;
        this.viewpoint.position.set(x, y - 0.01, 9);
        this.viewpoint.lookAt(x, y, 0);
        this.controls.target.set(x, y, 0);
      } else {
        const target = this.controls.target, dx = 0.1 * (x - target.x), dy = 0.1 * (y - target.y);
        target.x += dx; target.y += dy; this.viewpoint.position.x += dx; this.viewpoint.position.y += dy;
        this.controls.update();
      }
    },
    laser(scan) {
      const place = this.points.geometry.attributes.position;
      let n = 0;
      if (this.sensors && scan) {
        const [x, y, theta] = scan.pose;
        scan.laser.forEach((mm, i) => {
          if (mm === null || n >= place.count) return;
          const angle = theta + scan.laser_from + i * scan.laser_step;
          place.setXYZ(n, x + mm / 1000 * Math.cos(angle), y + mm / 1000 * Math.sin(angle), 0.2);
          n += 1;
        });
      }
      place.needsUpdate = true;
      this.points.geometry.setDrawRange(0, n);
    },
    key(event) {
      const turn = { j: [0.12, 0], l: [-0.12, 0], i: [0, -0.1], k: [0, 0.1] }[event.key], zoom = { ".": 0.85, ",": 1 / 0.85 }[event.key];
      if (!turn && !zoom) return;
      event.preventDefault();
      const offsetVector = this.viewpoint.position.clone().sub(this.controls.target), spherical = new this.three.Spherical();
      // Spherical measures from the y axis; here z is up.
      spherical.setFromCartesianCoords(offsetVector.x, offsetVector.z, -offsetVector.y);
      if (turn) { spherical.theta += turn[0]; spherical.phi = Math.min(Math.PI / 2 - 0.03, Math.max(0.05, spherical.phi + turn[1])); }
      if (zoom) spherical.radius = Math.min(40, Math.max(0.5, spherical.radius * zoom));
      offsetVector.setFromSpherical(spherical);
      this.viewpoint.position.copy(this.controls.target).add(new this.three.Vector3(offsetVector.x, -offsetVector.z, offsetVector.y));
    },
  },
};
