// While this is on a page, the driving keys move the robot.
import { live } from "/view-static/live.js";

export default {
  template: `<span hidden></span>`,
  mounted() { this.target = live.driveRobot(); live.keyTargets.add(this.target); },
  unmounted() { live.releaseKeys(); live.keyTargets.delete(this.target); },
};
