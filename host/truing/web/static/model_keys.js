// While this is on a page, the driving keys move the model robot: one cycle at once, then one every 100 ms.
import { live } from "/view-static/live.js";

const CYCLE_MS = 100;

export default {
  template: `<span hidden></span>`,
  mounted() {
    this.held = [];
    const cycle = () => { if (this.held.length) this.$emit("cycle", this.held); };
    this.user = {
      drivesRobot: false,
      keys: (held) => {
        const began = !this.held.length && held.length;
        this.held = held;
        if (began) { cycle(); this.timer = setInterval(cycle, CYCLE_MS); }
        if (!held.length) { clearInterval(this.timer); }
      },
      faster: (up) => this.$emit("speed", up),
      stop: () => { this.held = []; clearInterval(this.timer); this.$emit("stop", true); },
    };
    live.keyUsers.add(this.user);
  },
  unmounted() { clearInterval(this.timer); live._releaseAll(); live.keyUsers.delete(this.user); },
};
