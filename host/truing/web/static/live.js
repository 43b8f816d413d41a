// The page's web socket to the view's process: frames in, keys out, dead-man switch.
// A frame is requested when the last one has been drawn, so that a slow page never builds up a queue.

const HEARTBEAT_MS = 60;
const UNSEEN_MS = 500;             // after this time without a picture a frame is taken in all the same
const STOP_DEADLINE_MS = 300;      // after this time an unacknowledged stop is an alarm
const KEPT_SAMPLES = 20_000;        // eleven minutes at 30 Hz, for the plot that is scrolled back
const STALE_MS = 500;              // values older than this are drawn in grey
const KEYS = {
  ArrowUp: "forward", KeyW: "forward", ArrowDown: "back", KeyS: "back",
  ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
};

class Live {
  constructor() {
    this.views = new Set();          // functions called with each frame that is drawn
    this.watchers = new Set();       // functions called with each frame as it comes, for what cannot wait for a picture
    this.keyTargets = new Set();     // {keys(held), faster(up), stop()}: receivers of the driving keys; the last one is active
    this.state = {};                 // rarely changing state, merged from all frames
    this.samples = [];               // newest last
    this.trail = [];
    this.truth = [];
    this.held = new Set();
    this.frames = 0;
    this.received = 0;               // samples since the page was opened
    this.rate = 0;
    this.session = null;
    this.stopId = 0;                 // of this page's last stop
    this.stopDelivered = 0;          // newest of them that the board has acknowledged
    this.sampledAt = -Infinity;      // when the last sample arrived, by performance.now()
    this.stale = false;
    this.faults = [];                // of the board, as far as it has told
    this._shown = 0;
  }

  start(session) {
    if (this.session) return;
    this.session = session;
    window.truingLive = this;
    window.addEventListener("keydown", (e) => this._key(e, true), true);
    window.addEventListener("keyup", (e) => this._key(e, false), true);
    window.addEventListener("blur", () => this.releaseKeys());
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.releaseKeys(); });
    this._open();
    this._watchHeight();
    setInterval(() => this._heartbeat(), HEARTBEAT_MS);
    setInterval(() => { this.rate = this.frames; this.frames = 0; this._write("frame-rate", String(this.rate)); }, 1000);
  }

  send(message) {
    if (this.socket && this.socket.readyState === 1) this.socket.send(JSON.stringify(message));
  }

  get drives() { return this.state.driver === "you"; }

  _open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/live?session=${encodeURIComponent(this.session)}`);
    this.socket.binaryType = "arraybuffer";
    const decoder = new TextDecoder();
    this.socket.onopen = () => { document.body.classList.remove("view-lost"); this.send({ t: "next" }); this._sendStop(); };
    this.socket.onmessage = (event) => {
      const frame = JSON.parse(decoder.decode(event.data));
      this._merge(frame);
      for (const watch of this.watchers) watch(frame);
      const draw = (now) => {
        cancelAnimationFrame(picture);
        clearTimeout(unseen);
        this._draw(frame, now);
        this.send({ t: "next" });
      };
      const picture = requestAnimationFrame(draw);
      // A page in the background is given no pictures: it too must learn of a stop on another page.
      const unseen = setTimeout(() => draw(performance.now()), UNSEEN_MS);
    };
    this.socket.onclose = () => {
      document.body.classList.add("view-lost");
      this._write("link", "view not reachable");
      setTimeout(() => this._open(), 500);
    };
  }

  _merge(frame) {
    this.frames += 1;
    for (const name of ["link", "board", "task", "driver", "speed_fraction", "stop", "world", "grids", "frames"]) {
      if (name in frame) this.state[name] = frame[name];
    }
    if (frame.task?.saved && frame.task.saved !== this.savedRun) {
      if (this.savedRun !== undefined) window.truingAddress?.forgetRun();
      this.savedRun = frame.task.saved;
    } else if ("task" in frame) this.savedRun ??= "";
    if (frame.stop) this._stopDelivered(frame.stop.delivered);
    if (frame.scan) this.state.scan = frame.scan;
    if (frame.samples.length) {
      this.sampledAt = performance.now();
      this._checkAge();
      this.samples.push(...frame.samples);
      this.received += frame.samples.length;
      if (this.samples.length > KEPT_SAMPLES + 1000) this.samples.splice(0, this.samples.length - KEPT_SAMPLES);
      for (const s of frame.samples) addPoint(this.trail, s[8], s[9]);
    }
    if (frame.corrected) addPoint(this.truth, frame.corrected[0], frame.corrected[1]);
    this.odometry = frame.odometry;
    this.corrected = frame.corrected;
  }

  _draw(frame, now) {
    for (const view of this.views) view(frame, now);
    const last = this.samples[this.samples.length - 1];
    const write = (name, text) => this._write(name, text);
    if (last) {
      write("speed-left", signed(last[1], 3)); write("speed-right", signed(last[2], 3));
      write("command-left", last[3] === null ? "–" : signed(last[3], 3));
      write("command-right", last[4] === null ? "–" : signed(last[4], 3));
      write("effort-left", signed(100 * last[5], 1)); write("effort-right", signed(100 * last[6], 1));
      write("battery", last[7] === null ? "no reading" : last[7].toFixed(2));
      write("x", signed(last[8], 3)); write("y", signed(last[9], 3));
      write("theta", signed(degrees(last[10]), 1));
      write("forward", signed((last[1] + last[2]) / 2, 3));
      this._bar("effort-left", last[5]); this._bar("effort-right", last[6]);
    }
    if (frame.odometry && frame.corrected) {
      const error = Math.hypot(frame.odometry[0] - frame.corrected[0], frame.odometry[1] - frame.corrected[1]);
      write("odometry-error", (1000 * error).toFixed(0));
    }
    // Rarely changing state is written when it changes, and periodically for elements added since.
    if (now > this._shown + 200 || "link" in frame || "board" in frame || "task" in frame || "stop" in frame || "driver" in frame || "speed_fraction" in frame) {
      this._shown = now;
      this._showState(this.state);
    }
  }

  _showState(state) {
    const current = document.querySelector("nav a[aria-current]");
    if (current && current !== this._currentPage) { // on a narrow screen the navigation bar scrolls
      this._currentPage = current;
      current.scrollIntoView({ inline: "nearest", block: "nearest" });
    }
    if (state.link) this._showLink(state.link);
    this._showBoard(state.board);
    this._showTask(state.task);
    if (state.speed_fraction) this._write("speed-fraction", Math.round(100 * state.speed_fraction) + " %");
    if (!state.driver) return;
    this._write("driver", { none: "no driver", you: "you are driving", other: "another page is driving" }[state.driver]);
    document.body.dataset.driver = state.driver;
    for (const button of document.querySelectorAll("[data-live-claim]")) {
      const text = state.driver === "you" ? "Release control" : "Take control";
      if (button.textContent !== text) button.textContent = text;
      button.toggleAttribute("disabled", state.driver === "other");
    }
  }

  _watchHeight() { // the pages fill what the bar and the banner leave
    const parts = document.querySelectorAll(".bar-top, .fault-banner");
    if (parts.length < 2) { setTimeout(() => this._watchHeight(), 50); return; }
    const measure = () => {
      const [bar, banner] = [...parts].map((part) => part.offsetHeight), style = document.documentElement.style;
      style.setProperty("--bar", `${bar}px`);
      style.setProperty("--top", `${bar + banner}px`);
    };
    const observer = new ResizeObserver(measure);
    parts.forEach((part) => observer.observe(part));
  }

  _showLink(link) {
    document.body.dataset.link = link.state;
    this._write("link", link.virtual ? (link.state === "connected" ? "virtual robot" : `virtual robot: ${link.state}`) : link.state);
    this._write("link-message", link.message);
    this._write("link-next", link.next ? "Next: " + link.next : "");
    this._write("board-name", link.board ? (link.virtual ? "virtual " : "") + link.board : "no board");
    this._write("source-rate", link.rate_hz ? link.rate_hz.toFixed(0) + " Hz" : "–");
  }

  _showBoard(board) {
    const stop = this.stopDelivered < this.stopId ? "pending" : this.state.stop?.state ?? "none";
    document.body.dataset.stop = stop;
    const stopped = { none: board?.state, pending: "stopping", stopped: board?.state === "idle" ? "STOPPED" : board?.state };
    this._write("state", board ? stopped[stop] : "–");
    this._write("mode", board ? board.mode : "–");
    this._write("sequence", board ? board.sequence : "–");
    this._write("log", board ? (board.log_open ? "writing" : "closed") : "–");
    if (board) this.faults = board.faults; // a lost link does not clear a fault: the last known ones stay
    const faults = this.faults;
    document.body.dataset.faults = faults.length ? "yes" : "no";
    const key = JSON.stringify(faults);
    for (const list of document.querySelectorAll("[data-live-faults]")) {
      if (list.shownFaults === key) continue;
      list.shownFaults = key;
      list.replaceChildren(...faults.map((fault) => {
        const item = document.createElement("li"), name = document.createElement("b");
        name.textContent = fault.name + (fault.active ? " (present)" : " (latched)");
        item.append(name, document.createTextNode(` ${fault.cause}. Next: ${fault.next}`));
        return item;
      }));
    }
  }

  _showTask(task) {
    document.body.dataset.task = task ? task.stage : "";
    this._write("task", task ? `${task.name}: ${task.stage}` : "–");
    this._write("task-problem", task ? task.problem : "");
    this._write("task-saved", task && task.saved ? "saved: " + task.saved : "");
    for (const bar of document.querySelectorAll("[data-live-bar='task']")) {
      bar.style.width = 100 * (task ? task.progress : 0) + "%";
    }
  }

  _write(name, text) {
    for (const element of document.querySelectorAll(`[data-live='${name}']`)) {
      if (element.textContent !== text) element.textContent = text;
    }
  }

  _bar(name, value) {
    for (const bar of document.querySelectorAll(`[data-live-bar='${name}']`)) {
      bar.style.left = 50 + Math.min(0, value) * 50 + "%";
      bar.style.width = Math.abs(value) * 50 + "%";
    }
  }

  // ---- stop

  stop() {
    this.releaseKeys();
    this.stopId += 1;
    const id = this.stopId;
    this._sendStop();
    this._showBoard(this.state.board);
    flash();
    setTimeout(() => { if (this.stopDelivered < id) document.body.classList.add("stop-not-delivered"); }, STOP_DEADLINE_MS);
  }

  _sendStop() { // also after a reconnection, as long as it has not been acknowledged
    if (this.stopDelivered < this.stopId) this.send({ t: "stop", id: this.stopId });
  }

  _stopDelivered(id) {
    this.stopDelivered = Math.max(this.stopDelivered, id);
    if (this.stopDelivered >= this.stopId) document.body.classList.remove("stop-not-delivered");
  }

  _checkAge() {
    const stale = performance.now() - this.sampledAt > STALE_MS;
    if (stale === this.stale) return;
    this.stale = stale;
    document.body.classList.toggle("stale", stale);
    for (const view of this.views) view({}, performance.now());
  }

  // ---- keys

  _key(event, down) {
    if (event.ctrlKey || event.metaKey || event.altKey) { if (down) this._editKey(event); return; }
    const typing = event.target.closest?.("input:not([type=range]), textarea, select, [contenteditable=true]");
    const ownArrows = event.target.closest?.("input[type=range], [role=slider], [role=listbox], [role=option], [role=combobox], [role=menu], [role=tab], [role=radio]");
    if (event.code === "Space") {
      // A space is text only in a text field, and only while the robot is known to be at rest.
      const text = event.target.closest?.("textarea, [contenteditable=true], input:not([type=number], [type=range], [type=checkbox], [type=radio], [type=file])");
      const moving = this.stale || ["live", "sequence"].includes(this.state.board?.state);
      if (text && !moving) return;
      event.preventDefault(); event.stopPropagation();
      if (down && !event.repeat) { this.stop(); this.keyTarget()?.stop?.(); }
      return;
    }
    if (typing) return;
    const key = KEYS[event.code];
    if (key && !(ownArrows && event.code.startsWith("Arrow"))) {
      const target = this.keyTarget();
      if (!target) return;
      event.preventDefault();
      if (event.repeat) return;
      if (down) this.held.add(key); else this.held.delete(key);
      target.keys([...this.held]);
      return;
    }
    if (!down) return;
    if (event.key === "+" || event.key === "=") this.keyTarget()?.faster(true);
    else if (event.key === "-") this.keyTarget()?.faster(false);
    else if (event.key === "c" && !event.repeat) this.toggleControl();
    else if (/^[1-9]$/.test(event.key)) document.querySelectorAll("[data-page]")[event.key - 1]?.click();
    else if (event.key === "?") document.querySelector("[data-help]")?.click();
  }

  _editKey(event) { // undo and redo of the page, unless a text is being written
    const redo = event.key === "y" || event.key === "Z", undo = event.key === "z";
    if (!(undo || redo) || event.altKey || event.target.closest?.("input, textarea")) return;
    const button = document.querySelector(redo ? "[data-redo]" : "[data-undo]");
    if (button) { event.preventDefault(); button.click(); }
  }

  keyTarget() { return [...this.keyTargets].pop(); }

  toggleControl() { this.send({ t: this.drives ? "leave" : "claim" }); }

  press(key, down) { // on-screen buttons act like keys
    if (down) this.held.add(key); else this.held.delete(key);
    this.keyTarget()?.keys([...this.held]);
  }

  releaseKeys() {
    if (!this.held.size) return;
    this.held.clear();
    this.keyTarget()?.keys([]);
  }

  _heartbeat() {
    this._checkAge();
    const target = this.keyTarget();
    if (this.drives) this.send({ t: "keys", keys: target && target.drivesRobot ? [...this.held] : [] });
  }

  driveRobot() { // the default target of the keys: the robot
    return {
      drivesRobot: true,
      keys: (held) => { if (!this.drives && held.length) this.send({ t: "claim" }); this.send({ t: "keys", keys: held }); },
      faster: (up) => this.send({ t: up ? "faster" : "slower" }),
    };
  }
}

function addPoint(line, x, y) {
  const last = line[line.length - 1];
  if (!last || Math.hypot(x - last[0], y - last[1]) > 0.01) line.push([x, y]);
  if (line.length > 6000) line.splice(0, 1000);
}

function flash() {
  document.body.classList.add("stopped-now");
  setTimeout(() => document.body.classList.remove("stopped-now"), 250);
}

export function signed(value, digits) { return (value < 0 ? "−" : " ") + Math.abs(value).toFixed(digits); }
export function degrees(angle) { const d = (angle * 180 / Math.PI) % 360; return d > 180 ? d - 360 : d < -180 ? d + 360 : d; }

export const live = new Live();
window.truing = { live };

document.addEventListener("click", (event) => {
  const element = event.target.closest?.("[data-live-claim], [data-live-stop], [data-live-trail]");
  if (!element) return;
  if (element.hasAttribute("data-live-claim")) live.toggleControl();
  else if (element.hasAttribute("data-live-stop")) { live.stop(); }
  else { live.trail.length = 0; live.truth.length = 0; }
});

// A press counts for what was under the pointer when it began. A text that comes or goes above a button moves it
// between press and release, and the browser then clicks neither.
let pressed = null;
document.addEventListener("pointerdown", (event) => {
  const element = event.isPrimary && event.button === 0 && event.target.closest?.("button, a[href], summary, label");
  pressed = element ? { element, x: event.clientX, y: event.clientY } : null;
}, true);
document.addEventListener("pointerup", (event) => {
  const press = pressed;
  pressed = null;
  if (!press || press.element.contains(event.target) || !press.element.isConnected) return;
  if (Math.hypot(event.clientX - press.x, event.clientY - press.y) < 6) press.element.click();
}, true);

// A plot may be resized while its page is being left: that it is no longer displayed is not an error.
window.addEventListener("unhandledrejection", (event) => {
  if (String(event.reason?.message ?? event.reason).startsWith("Resize must be passed a displayed plot")) event.preventDefault();
});

for (const [event, down] of [["pointerdown", true], ["pointerup", false], ["pointercancel", false], ["pointerleave", false]]) {
  document.addEventListener(event, (e) => {
    const button = e.target.closest?.("[data-live-key]");
    if (button && (down || live.held.has(button.dataset.liveKey))) {
      if (down) e.preventDefault();
      live.press(button.dataset.liveKey, down);
    }
  }, true);
}
