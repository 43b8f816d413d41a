// While this is on a page, the driving keys move the model robot: one cycle immediately, then one every 100 ms.
import { live } from "/view-static/live.js";

const CYCLE_MS = 100;

export default {
  template: `<span hidden></span>`,
  mounted() {
    this.held = [];
    const cycle = () => { if (this.held.length) this.$emit("cycle", this.held); };
    this.target = {
      drivesRobot: false,
      keys: (held) => {
        const started = !this.held.length && held.length;
        this.held = held;
        if (started) { cycle(); this.timer = setInterval(cycle, CYCLE_MS); }
        if (!held.length) { clearInterval(this.timer); }
      },
      faster: (up) => this.$emit("speed", up),
      stop: () => { this.held = []; clearInterval(this.timer); this.$emit("stop", true); },
    };
    live.keyTargets.add(this.target);
  },
  unmounted() { clearInterval(this.timer); live.releaseKeys(); live.keyTargets.delete(this.target); },
};
