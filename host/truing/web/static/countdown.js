// A button that counts down before it acts. Any key, a press anywhere and a stop on any page end the countdown.
import { live } from "/view-static/live.js";

export default {
  template: `<div class="countdown"><button type="button" class="plain strong" ref="button" @click="begin" :disabled="left > 0">{{ text }}</button>
    <p class="num" role="status" aria-live="assertive">{{ left > 0 ? "moves in " + left + " s: any key stops" : message }}</p></div>`,
  props: { text: String, seconds: Number },
  data: () => ({ left: 0, message: "" }),
  mounted() {
    this.stopping = (event) => { if (this.left && !event.repeat) this.cancel("stopped: nothing has moved"); };
    this.watch = (frame) => { if (this.left && frame.stop) this.cancel("stopped: nothing has moved"); };
    // keyup is no key press: the one that pressed the button is released after the beginning.
    for (const kind of ["keydown", "pointerdown"]) window.addEventListener(kind, this.stopping, true);
    window.addEventListener("blur", this.stopping);
    live.watchers.add(this.watch);
    this.$refs.button.focus();
  },
  unmounted() {
    this.cancel("");
    for (const kind of ["keydown", "pointerdown"]) window.removeEventListener(kind, this.stopping, true);
    window.removeEventListener("blur", this.stopping);
    live.watchers.delete(this.watch);
  },
  methods: {
    begin() {
      if (this.left) return;
      this.left = this.seconds;
      this.$emit("begin", true);
      this.timer = setInterval(() => {
        this.left -= 1;
        if (this.left > 0) return;
        clearInterval(this.timer);
        this.message = "started";
        this.$emit("go", true);
      }, 1000);
    },
    cancel(message) {
      if (!this.left) return;
      clearInterval(this.timer);
      this.left = 0; this.message = message;
      this.$emit("cancelled", true);
    },
  },
};
