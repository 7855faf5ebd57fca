// Drawing of the floor with everything on it, at one time.

const FLOOR_WIDTH = 2362;
const FLOOR_HEIGHT = 1143;
const MARGIN = 150;
const CLOSEST = 640;
const BEYOND = 400; // mm outside the floor that are still shown
const COLOURS = {
  ink: "#1c2630", left: "#0b4a86", right: "#d9791a", pen: "#e79b9b", fault: "#a3162a", second: "#7a3e9d",
  paper: "#ffffff", axle: "#e6007e", beyond: "#a3aab1", obstacle: "#c8cdd2", over: "#00736a",
};
// Styles of a robot and its path: the first robot, the second robot, and those of the overlaid trial.
const LOOKS = [
  { path: COLOURS.left, ahead: "rgba(28, 38, 48, 0.55)", pen: COLOURS.pen, dash: [], edged: [], edge: COLOURS.ink,
    body: "rgba(255, 255, 255, 0.66)", axle: COLOURS.axle },
  { path: COLOURS.second, ahead: "rgba(28, 38, 48, 0.55)", pen: COLOURS.pen, dash: [], edged: [], edge: COLOURS.second,
    body: "rgba(238, 228, 244, 0.72)", axle: COLOURS.second },
];
const LOOK_OF_OVER = { path: COLOURS.over, ahead: "rgba(0, 115, 106, 0.5)", pen: "#8fd0c3", dash: [10, 7], edged: [5, 3],
  edge: COLOURS.over, body: "rgba(222, 243, 239, 0.5)", axle: "#00a693" };
const FONT = "system-ui, sans-serif";

class FloorCanvas {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.ground = document.createElement("canvas");
    this.trail = document.createElement("canvas");
    this.mode = "path";
  }

  // Shows a trial. `over` is the overlaid trial, or null.
  show(trial, over) {
    Object.assign(this, { trial, over, drawnGround: null, reachedRegion: null });
    this.tracks = trial.robots.map((robot, which) => ({ robot, run: trial, look: LOOKS[which ? 1 : 0] }));
    if (over) this.tracks.unshift(...over.robots.map((robot) => ({ robot, run: over, look: LOOK_OF_OVER })));
  }

  // Returns the visible part of the world: its lower left corner, width and height in mm.
  region(ticks) {
    const aspect = this.canvas.clientHeight / this.canvas.clientWidth || 0.5;
    let [left, bottom, right, top] = [0, 0, FLOOR_WIDTH, FLOOR_HEIGHT];
    if (this.mode === "near") {
      const [x, y] = this.trial.robots[0].pose(ticks);
      return fitted(x, y, 0, 0, aspect);
    }
    if (this.mode === "path") [left, bottom, right, top] = this.reached();
    const region = fitted(left, bottom, right - left, top - bottom, aspect);
    region.left = within(region.left, region.width, Math.min(0, left), Math.max(FLOOR_WIDTH, right));
    region.bottom = within(region.bottom, region.height, Math.min(0, bottom), Math.max(FLOOR_HEIGHT, top));
    return region;
  }

  // Returns the region with all positions of the robots, the beacon and lost criteria, with a margin.
  reached() {
    if (this.reachedRegion) return this.reachedRegion;
    const places = this.trial.lost.map((loss) => loss.pose);
    if (this.trial.beacon) places.push(this.trial.beacon);
    for (const { robot } of this.tracks) {
      for (let tick = 0; tick <= robot.length; tick += 1) places.push(robot.row(tick));
    }
    let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
    for (const [x, y] of places) {
      if (Number.isNaN(x + y)) continue;
      west = Math.min(west, x);
      east = Math.max(east, x);
      south = Math.min(south, y);
      north = Math.max(north, y);
    }
    this.reachedRegion = [Math.max(west, -BEYOND) - MARGIN, Math.max(south, -BEYOND) - MARGIN,
      Math.min(east, FLOOR_WIDTH + BEYOND) + MARGIN, Math.min(north, FLOOR_HEIGHT + BEYOND) + MARGIN];
    return this.reachedRegion;
  }

  draw(t, speed) {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.round(this.canvas.clientWidth * ratio);
    const height = Math.round(this.canvas.clientHeight * ratio);
    if (!width || !height) return;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    const ticks = this.trial.ticks(t);
    const region = this.region(ticks);
    const scale = this.canvas.clientWidth / region.width;
    const at = (x, y) => [(x - region.left) * scale, (region.bottom + region.height - y) * scale];
    this.place = { at, scale, ratio, region };
    this.canvas.dataset.region = [region.left, region.bottom, region.width, region.height].join(" ");
    this.drawGround(width, height);
    const context = this.context;
    context.setTransform(1, 0, 0, 1, 0, 0);
    this.drawTrail(t);
    context.drawImage(this.ground, 0, 0);
    context.drawImage(this.trail, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    for (const track of this.tracks) this.drawRobot(track, t);
    if (this.over) this.drawOver(t);
    this.drawMisread(t, speed);
    this.drawTouches(t);
    this.drawLosses(t);
    this.drawTalk(t, ticks, speed);
    for (const { robot, run, look } of this.tracks) {
      const [x, y] = at(...robot.pose(run.ticks(t)));
      const mark = run === this.over ? diamond : dot;
      mark(context, x, y, 4.5, COLOURS.paper);
      mark(context, x, y, 3, look.axle);
    }
  }

  // Draws everything that does not move, again only if the visible region changes.
  drawGround(width, height) {
    const { at, scale, ratio, region } = this.place;
    const drawn = [width, height, region.left, region.bottom, region.width].join(" ");
    if (drawn === this.drawnGround) return;
    this.drawnGround = drawn;
    this.drawnTrail = null;
    this.ground.width = width;
    this.ground.height = height;
    const context = this.ground.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = COLOURS.beyond;
    context.fillRect(0, 0, width, height);
    const [x, y] = at(0, FLOOR_HEIGHT);
    context.fillStyle = COLOURS.paper;
    context.fillRect(x, y, FLOOR_WIDTH * scale, FLOOR_HEIGHT * scale);
    if (this.trial.floorImage) {
      context.imageSmoothingQuality = "high";
      context.drawImage(this.trial.floorImage, x, y, FLOOR_WIDTH * scale, FLOOR_HEIGHT * scale);
    }
    context.lineWidth = 1.5;
    context.strokeStyle = COLOURS.ink;
    for (const [left, bottom, across, up] of this.trial.obstacles) {
      const corner = at(left, bottom + up);
      context.fillStyle = COLOURS.obstacle;
      context.fillRect(...corner, across * scale, up * scale);
      context.strokeRect(...corner, across * scale, up * scale);
    }
    if (this.trial.beacon) drawBeacon(context, ...at(...this.trial.beacon));
    for (const { robot, look } of this.tracks) {
      robot.seen = this.thinned(robot);
      this.strokePath(context, robot, 0, robot.length, look.ahead, 1, [2, 3]);
    }
  }

  // Returns ticks of a path at least a pixel apart, with their position and distance in pixels.
  thinned(robot) {
    const kept = [];
    let [lastX, lastY, way] = [NaN, NaN, 0];
    for (let tick = 0; tick <= robot.length; tick += 1) {
      const [x, y] = this.place.at(...robot.row(tick));
      if (Number.isNaN(x + y) || Math.abs(x - lastX) + Math.abs(y - lastY) < 1) continue;
      const [worldX, worldY] = robot.row(tick);
      if (kept.length) way += Math.hypot(x - lastX, y - lastY);
      kept.push([tick, worldX, worldY, way]);
      [lastX, lastY] = [x, y];
    }
    return kept;
  }

  strokePath(context, robot, from, until, colour, width, dash = []) {
    const begin = this.place.at(...robot.pose(from));
    let before = 0; // pixels from the start, so that dashes continue the previous ones
    context.beginPath();
    context.moveTo(...begin);
    for (const [tick, x, y, way] of robot.seen) {
      if (tick <= from) {
        const [keptX, keptY] = this.place.at(x, y);
        before = way + Math.hypot(begin[0] - keptX, begin[1] - keptY);
        continue;
      }
      if (tick > until) break;
      context.lineTo(...this.place.at(x, y));
    }
    context.lineTo(...this.place.at(...robot.pose(until)));
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineJoin = "round";
    context.setLineDash(dash);
    context.lineDashOffset = before;
    context.stroke();
    context.setLineDash([]);
  }

  // Draws the robots' trails: extends them, or redraws them if time goes back.
  drawTrail(t) {
    const context = this.trail.getContext("2d");
    if (this.drawnTrail === null || t < this.drawnTrail) {
      this.trail.width = this.ground.width;
      this.trail.height = this.ground.height;
      this.drawnTrail = -1;
    }
    context.setTransform(this.place.ratio, 0, 0, this.place.ratio, 0, 0);
    for (const { robot, run, look } of this.tracks) {
      const from = Math.max(0, run.ticks(this.drawnTrail));
      const until = Math.min(run.ticks(t), robot.length);
      for (const [down, up] of robot.pen) {
        const [begins, ends] = [Math.max(from, down), Math.min(until, up)];
        const width = Math.max(4, 8 * this.place.scale);
        if (begins < ends) this.strokePath(context, robot, begins, ends, look.pen, width, look.dash);
      }
      if (from < until) {
        this.strokePath(context, robot, from, until, COLOURS.paper, 4);
        this.strokePath(context, robot, from, until, look.path, 2, look.dash);
      }
      this.drawImages(context, robot, t);
    }
    this.drawnTrail = t;
  }

  drawImages(context, robot, t) {
    for (const image of robot.images) {
      if (image.t > t + ALMOST) break;
      if (image.t <= this.drawnTrail + ALMOST) continue;
      const [x, y] = this.place.at(...placed(image.pose, robot.body.left));
      const side = Math.max(8, image.side * this.place.scale);
      const wrong = isMisread(image);
      outlined(context, wrong ? COLOURS.fault : COLOURS.ink, wrong ? 2.5 : 1.5, () =>
        context.rect(x - side / 2, y - side / 2, side, side));
    }
  }

  drawMisread(t, speed) {
    for (const robot of this.trial.robots) {
      const image = latestImage(robot, t);
      if (!image || !isMisread(image) || t - image.t > lasting(speed)) continue;
      const [x, y] = this.place.at(...placed(image.pose, robot.body.left));
      const below = Math.max(8, image.side * this.place.scale) / 2 + 14;
      this.bubble(say("takenFor", { answer: image.answer ?? say("nothing") }), x, y + below, COLOURS.fault);
    }
  }

  drawTouches(t) {
    for (const event of this.trial.events) {
      if (event.t > t + ALMOST) break;
      if (event.pose) {
        const [x, y] = this.place.at(...event.pose);
        outlined(this.context, COLOURS.fault, 2.5, () => cross(this.context, x, y, 7));
      }
    }
  }

  // Draws a numbered pin where each criterion was lost, with a ring at its time.
  drawLosses(t) {
    const taken = [];
    this.trial.lost.forEach((loss, index) => {
      const place = this.place.at(...loss.pose);
      let x = place[0];
      const y = place[1] < 46 ? place[1] + 34 : place[1] - 34;
      while (taken.some(([otherX, otherY]) => Math.hypot(x - otherX, y - otherY) < 23)) x += 24;
      taken.push([x, y]);
      outlined(this.context, COLOURS.fault, 2, () => {
        this.context.moveTo(...place);
        this.context.lineTo(x, y);
      });
      if (Math.abs(loss.t - t) < 0.5) outlined(this.context, COLOURS.fault, 2.5, () => this.context.arc(...place, 10, 0, 7));
      dot(this.context, x, y, 12, COLOURS.paper);
      dot(this.context, x, y, 10.5, COLOURS.fault);
      written(this.context, String(index + 1), x, y, COLOURS.paper, "bold 12px");
    });
  }

  // Draws the other robot's name if it is elsewhere, and the place where the two diverge.
  drawOver(t) {
    const [mine, others] = [this.trial, this.over].map((run) => this.place.at(...run.robots[0].pose(run.ticks(t))));
    if (Math.hypot(mine[0] - others[0], mine[1] - others[1]) > 30) {
      this.bubble(this.over.name, others[0], others[1] + (others[1] > mine[1] ? 34 : -34), COLOURS.over);
    }
    if (this.over.parted !== null && Math.abs(this.over.parted - t) < 0.5) {
      const place = this.place.at(...this.trial.robots[0].pose(this.trial.ticks(this.over.parted)));
      outlined(this.context, COLOURS.over, 2.5, () => this.context.arc(...place, 16, 0, 7));
    }
  }

  drawRobot({ robot, run, look }, t) {
    const context = this.context;
    const { at, scale } = this.place;
    const ticks = run.ticks(t);
    const [x, y, heading] = robot.pose(ticks);
    const body = robot.body;
    const thin = 1.2 / scale;
    context.save();
    context.translate(...at(x, y));
    context.rotate((-heading * Math.PI) / 180);
    context.scale(scale, scale);
    const [distance] = robot.reading("ultrasonic", ticks);
    if (distance !== undefined) drawRay(context, body.ultrasonic, distance, scale);
    context.beginPath();
    context.roundRect(body.back, -body.half_width, body.front - body.back, 2 * body.half_width, 12);
    context.fillStyle = look.body;
    context.fill();
    context.strokeStyle = look.edge;
    context.lineWidth = 1.6 * thin;
    context.setLineDash(look.edged.map((pixels) => pixels / scale));
    context.stroke();
    context.setLineDash([]);
    for (const [side, name] of [[-1, "left_position"], [1, "right_position"]]) {
      drawWheel(context, body, side, robot.reading(name, ticks)[0] ?? 0, thin);
    }
    for (const side of ["left", "right"]) {
      const [right, forward, diameter] = body[side];
      const light = robot.reading(`${side}_rgb`, ticks);
      context.beginPath();
      context.arc(forward, right, diameter / 2, 0, 7);
      context.fillStyle = light.length === 3 ? rgb(light) : COLOURS.paper;
      context.fill();
      context.strokeStyle = COLOURS[side];
      context.lineWidth = 2 * thin;
      context.stroke();
    }
    context.restore();
  }

  // Draws the latest message between sender and receiver, and the latest speech.
  drawTalk(t, ticks, speed) {
    const lasts = lasting(speed);
    const count = this.trial.count(t);
    const width = this.canvas.clientWidth;
    let message = null;
    let words = null;
    let printed = null;
    for (let index = count - 1; index >= 0 && this.trial.happened[index].t > t - lasts - 5; index -= 1) {
      const each = this.trial.happened[index];
      const until = Math.max(each.t, each.arrived ?? each.t) + lasts;
      if (until < t) continue;
      if (each.kind === "message") message ??= each;
      else if (each.kind === "said" || each.kind === "fault") words ??= each;
      else if (each.kind === "printed") printed ??= each;
    }
    const ends = Object.fromEntries(this.trial.robots.map((robot) => [robot.name, this.place.at(...robot.pose(ticks))]));
    const responder = this.trial.beacon ? this.place.at(...this.trial.beacon) : [width - 58, 20];
    if (message) {
      const from = ends[message.from] ?? responder;
      const to = ends[message.to] ?? responder;
      this.drawLink(message, from, to, t);
    }
    if (this.trial.messages.length && !this.trial.beacon && this.trial.robots.length === 1) {
      const sent = this.trial.messages.find((each) => each.from === this.trial.robots[0].name);
      chip(this.context, worded("called", sent?.to ?? "responder"), width - 58, 20);
    }
    words ??= message ? null : printed; // prints to the other end are shown as messages
    if (words) {
      const [x, y] = ends[words.who] ?? ends[this.trial.robots[0].name];
      const quoted = words.kind === "said" ? `“${words.text}”` : words.text;
      this.bubble(quoted, x, y + 40, words.kind === "fault" ? COLOURS.fault : COLOURS.ink);
    }
  }

  drawLink(message, from, to, t) {
    const context = this.context;
    const lost = message.arrived === null;
    context.save();
    context.setLineDash([5, 4]);
    outlined(context, lost ? COLOURS.fault : COLOURS.left, 1.8, () => {
      context.moveTo(...from);
      context.lineTo(...to);
    });
    context.restore();
    const way = lost ? 0.5 : Math.min(1, (t - message.t) / Math.max(ALMOST, message.arrived - message.t));
    const [x, y] = [from[0] + (to[0] - from[0]) * way, from[1] + (to[1] - from[1]) * way];
    if (lost) outlined(context, COLOURS.fault, 2.5, () => cross(context, x, y, 6));
    else dot(context, x, y, 5, COLOURS.left);
    const what = message.befell ? `${message.befell}: ${message.text}` : message.text;
    this.bubble(`${wayWords(message)}: ${what}`, from[0], from[1] + (from[1] < 80 ? 32 : -60),
      lost ? COLOURS.fault : COLOURS.left);
  }

  bubble(text, x, y, colour) {
    const { clientWidth, clientHeight } = this.canvas;
    const context = this.context;
    context.font = `12px ${FONT}`;
    const shown = shortened(context, text.replace(/\s+/g, " "), Math.min(300, clientWidth - 24));
    const half = context.measureText(shown).width / 2;
    const middle = Math.max(half + 10, Math.min(x, clientWidth - half - 10));
    label(context, shown, middle, Math.max(14, Math.min(y, clientHeight - 14)), colour);
  }
}
