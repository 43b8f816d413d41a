// While this is on a page, the driving keys move the robot.
import { live } from "/view-static/live.js";

export default {
  template: `<span hidden></span>`,
  mounted() { this.user = live.driveRobot(); live.keyUsers.add(this.user); },
  unmounted() { live._releaseAll(); live.keyUsers.delete(this.user); },
};
