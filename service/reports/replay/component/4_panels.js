// The panels beside the floor: sensor readings, events, source, and a table of everything.

const RECENT = 7;
const MOST_ROWS = 1500;
const WIDE = matchMedia("(min-width: 48rem)"); // as in replay.css: on a phone the numbers are folded

// Creates an element with properties and children. Strings become text, never markup.
function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

function seconds(t) {
  return `${t.toFixed(2)} s`;
}

// Returns a link to a moment. Rounding never makes it earlier.
function momentHash(trial, t) {
  return `#trial=${trial.trial}&t=${Math.ceil(t * 1000 - ALMOST) / 1000}`;
}

function momentLink(trial, t) {
  return element("a", { href: momentHash(trial, t) }, seconds(t));
}

class SensorPanel {
  constructor() {
    this.eyes = {};
    const eyes = element("div", { className: "eyes" });
    for (const [key, title] of [["left", worded("readings", "left_rgb")], ["right", worded("readings", "right_rgb")],
      ["sentLeft", say("sentLeft")], ["sentRight", say("sentRight")]]) {
      const canvas = element("canvas", { width: 120, height: 120, role: "img", "aria-label": title });
      const figure = element("figure", {}, canvas, element("figcaption", {}, title));
      this.eyes[key] = { canvas, figure };
      eyes.append(figure);
    }
    this.sent = element("p", { className: "sent small" });
    this.readings = element("dl", { className: "readings" });
    const readings = element("details", { className: "all-readings", open: WIDE.matches },
      element("summary", {}, say("readings")), this.readings);
    this.root = element("section", { className: "sensors" }, element("h3", {}, say("senses")), eyes, this.sent, readings);
  }

  show(trial) {
    this.trial = trial;
    this.lastSent = undefined;
    const hasSent = trial.robots[0].images.length > 0;
    for (const key of ["sentLeft", "sentRight"]) this.eyes[key].figure.hidden = !hasSent;
    this.sent.hidden = !hasSent;
    this.cells = new Map();
    this.readings.replaceChildren();
    const robot = trial.robots[0];
    for (const name of ["place", ...Object.keys(robot.columns)]) {
      if (["x", "y", "heading"].includes(name)) continue;
      const value = element("dd");
      this.cells.set(name, value);
      this.readings.append(element("dt", {}, name === "place" ? say("robot") : worded("readings", name).replaceAll("_", " ")), value);
    }
  }

  draw(t) {
    const robot = this.trial.robots[0];
    const ticks = this.trial.ticks(t);
    const pose = robot.pose(ticks);
    for (const side of ["left", "right"]) this.drawEye(side, robot, pose);
    for (const [name, cell] of this.cells) {
      const text = name === "place" ? placeWords(pose) : readingWords(robot, name, ticks);
      if (cell.textContent !== text) cell.textContent = text;
    }
    this.drawSent(robot, t);
  }

  // Draws the floor under the sensor. The window is aligned with the axes at any heading.
  drawEye(side, robot, pose) {
    const { canvas } = this.eyes[side];
    const context = canvas.getContext("2d");
    const [right, forward, diameter] = robot.body[side];
    const [x, y] = placed(pose, [right, forward]);
    const [column, row] = [Math.trunc(x - diameter / 2), Math.trunc(FLOOR_HEIGHT - y - diameter / 2)];
    context.fillStyle = "#000000";
    context.fillRect(0, 0, canvas.width, canvas.height);
    const floor = this.trial.floorImage;
    if (!floor || Number.isNaN(x + y)) return;
    const [per, side_] = [floor.naturalWidth / FLOOR_WIDTH, canvas.width / diameter];
    context.save();
    context.beginPath();
    context.arc(canvas.width / 2, canvas.height / 2, canvas.width / 2, 0, 7);
    context.clip();
    context.imageSmoothingEnabled = false;
    context.drawImage(floor, column * per, row * per, diameter * per, diameter * per, 0, 0, diameter * side_,
      diameter * side_);
    context.restore();
  }

  drawSent(robot, t) {
    const latest = latestImage(robot, t);
    if (latest === this.lastSent) return;
    this.lastSent = latest;
    drawPixels(this.eyes.sentLeft.canvas, latest && latest.left, latest && latest.side);
    drawPixels(this.eyes.sentRight.canvas, latest && latest.right, latest && latest.side);
    this.sent.textContent = latest ? sentWords(latest) : say("noImage");
    this.sent.classList.toggle("wrong", Boolean(latest) && isMisread(latest));
  }
}

function placeWords([x, y, heading]) {
  const tenths = ((Math.round(heading * 10) % 3600) + 3600) % 3600;
  return say("place", { x: x.toFixed(1), y: y.toFixed(1), heading: (tenths / 10).toFixed(1) });
}

function readingWords(robot, name, ticks) {
  const values = robot.reading(name, ticks);
  if (!values.length) return "–";
  if (values.length === 3) return values.map((value, part) => `${"RGB"[part]} ${Math.round(value)}`).join("  ");
  const unit = robot.units[name];
  return `${values.map((value) => value.toFixed(unit === "mm" ? 0 : 1)).join(", ")}${words().units[unit] ?? ` ${unit}`}`;
}

function sentWords(image) {
  const parts = { ...image, seconds: seconds(image.t) };
  if (image.truth === undefined) return say("sent", parts);
  if (!isMisread(image)) return say("named", parts);
  return say(image.answer === null ? "notNamed" : "taken", parts);
}

function drawPixels(canvas, told, side) {
  const context = canvas.getContext("2d");
  context.clearRect(0, 0, canvas.width, canvas.height);
  if (!told) return;
  const bytes = atob(told);
  if (bytes.length !== side * side * 3) return;
  const small = element("canvas", { width: side, height: side });
  const pixels = new ImageData(side, side);
  for (let pixel = 0; pixel < side * side; pixel += 1) {
    for (let part = 0; part < 3; part += 1) pixels.data[4 * pixel + part] = bytes.charCodeAt(3 * pixel + part);
    pixels.data[4 * pixel + 3] = 255;
  }
  small.getContext("2d").putImageData(pixels, 0, 0);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, 0, 0, canvas.width, canvas.height);
}

// Returns the events of the other trial with its name.
function happenedOver(over) {
  return over.happened.map((item) => ({ ...item, whose: over.name }));
}

// Returns the words for one event: who, what, and the result for the receiver.
function happenedWords(item) {
  const whose = item.whose ? `${item.whose}: ` : "";
  const [kind, wrong] = [worded("kinds", item.kind), isWrong(item)];
  if (item.kind !== "message") {
    return { who: whose + worded("called", item.who), kind, text: item.text, outcome: "", wrong };
  }
  return { who: whose + wayWords(item), kind, text: item.text, outcome: outcomeWords(item), wrong };
}

function wayWords(message) {
  return `${worded("called", message.from)} → ${worded("called", message.to)}`;
}

function outcomeWords(message) {
  if (message.arrived === null) return say("neverArrived", { befell: message.befell ?? say("notAnswered") });
  const befell = message.befell ? `${message.befell}; ` : "";
  const arrived = befell + say("arrived", { seconds: seconds(message.arrived) });
  return message.arrived_as === undefined ? arrived : say("arrivedAs", { arrived, text: message.arrived_as });
}

function isWrong(item) {
  return ["fault", "touched", "lost"].includes(item.kind) || (item.kind === "message" && (item.arrived === null || Boolean(item.befell)));
}

class HappenedPanel {
  constructor() {
    this.list = element("ol", { className: "happened" });
    this.root = element("section", { className: "now" }, element("h3", {}, say("happens")), this.list);
  }

  show(trial, over) {
    Object.assign(this, { trial, over, shown: "" });
    this.happenedOver = over ? happenedOver(over) : [];
  }

  draw(t) {
    const [count, countOver] = [this.trial.count(t), this.over ? this.over.count(t) : 0];
    const shown = `${count} ${countOver}`;
    if (shown === this.shown) return;
    this.shown = shown;
    const recent = [...this.trial.happened.slice(Math.max(0, count - RECENT), count),
      ...this.happenedOver.slice(Math.max(0, countOver - RECENT), countOver)].sort((a, b) => a.t - b.t).reverse();
    this.list.replaceChildren(...recent.map((item) => this.row(item)));
    if (!recent.length) this.list.append(element("li", { className: "soft" }, say("nothingYet")));
  }

  row(item) {
    const words = happenedWords(item);
    const states = [item.kind, words.wrong ? "wrong" : "", item.whose ? "of-over" : ""];
    const row = element("li", { className: states.join(" ") }, momentLink(this.trial, item.t),
      element("span", { className: "who" }, item.kind === "message" ? words.who : `${words.who}: ${words.kind}`),
      element("span", { className: "what" }, words.text));
    if (words.outcome) row.append(element("span", { className: "outcome" }, words.outcome));
    return row;
  }
}

class SourcePanel {
  constructor(sources) {
    this.sources = sources;
    this.choice = element("select", { "aria-label": say("source") },
      ...sources.map((source, index) => element("option", { value: index }, source.name)));
    this.choice.addEventListener("change", () => this.open(Number(this.choice.value)));
    this.lines = element("ol");
    this.window = element("div", { className: "lines", tabIndex: 0, role: "region", "aria-label": say("linesOfSource") },
      this.lines);
    this.known = element("p", { className: "small soft" });
    this.root = element("section", { className: "source", hidden: !sources.length },
      element("div", { className: "source-head" }, element("h3", {}, say("source")), this.choice), this.window, this.known);
    this.choice.hidden = sources.length < 2;
  }

  show(trial) {
    this.trial = trial;
    this.at = undefined;
    if (this.sources.length) this.open(0);
  }

  open(index) {
    const { lines, more } = this.sources[index];
    this.opened = index;
    this.choice.value = String(index);
    this.lines.replaceChildren(...lines.map((line) => element("li", {}, line || " ")));
    if (more) this.lines.append(element("li", { className: "soft" }, say("moreLines", { count: more })));
  }

  // Highlights the line that caused the latest event with a known line.
  draw(t) {
    if (!this.sources.length) return;
    let latest = null;
    for (let index = this.trial.count(t) - 1; index >= 0 && !latest; index -= 1) {
      if (this.trial.happened[index].line) latest = this.trial.happened[index];
    }
    if (latest === this.at) return;
    this.at = latest;
    const earlier = this.lines.querySelector("[aria-current]");
    earlier?.removeAttribute("aria-current");
    earlier?.classList.remove("wrong");
    this.known.textContent = latest ? say("line", { number: latest.line[1], seconds: seconds(latest.t) })
      : say("lineUnknown");
    if (!latest) return;
    const [source, line] = latest.line;
    if (source !== this.opened) this.open(source);
    const marked = this.lines.children[line - 1];
    if (!marked) return;
    marked.setAttribute("aria-current", "step");
    marked.classList.toggle("wrong", latest.kind === "fault");
    this.window.scrollTop = marked.offsetTop - this.window.clientHeight / 2;
  }
}

class EventTable {
  constructor() {
    this.body = element("tbody");
    this.more = element("p", { className: "small soft" });
    const head = ["time", "who", "what", "text", "cameOfIt"].map((title) => element("th", { scope: "col" }, say(title)));
    this.root = element("details", { className: "events" }, element("summary", {}, say("allAsTable")),
      element("div", { className: "scroll" }, element("table", {}, element("thead", {}, element("tr", {}, ...head)), this.body)),
      this.more);
    this.root.addEventListener("toggle", () => this.fill());
  }

  show(trial, over) {
    Object.assign(this, { trial, over, filled: false });
    this.fill();
  }

  fill() {
    if (!this.root.open || this.filled) return;
    this.filled = true;
    const lost = this.trial.lost.map((loss) => ({ ...loss, who: loss.title, kind: "lost" }));
    const images = this.trial.robots.flatMap((robot) =>
      robot.images.map((image) => ({ t: image.t, who: robot.name, kind: "image", text: sentWords(image) })));
    const others = this.over ? happenedOver(this.over) : [];
    const all = [...this.trial.happened, ...others, ...lost, ...images].sort((a, b) => a.t - b.t);
    this.body.replaceChildren(...all.slice(0, MOST_ROWS).map((item) => {
      const { who, kind, text, outcome, wrong } = happenedWords(item);
      const place = item.pose ? placeWords(item.pose) : outcome;
      const states = [wrong ? "wrong" : "", item.whose ? "of-over" : ""];
      return element("tr", { className: states.join(" ").trim() },
        element("td", { className: "number" }, momentLink(this.trial, item.t)),
        ...[who, kind, text, place].map((cell) => element("td", {}, cell)));
    }));
    const missing = Math.max(0, all.length - MOST_ROWS) + this.trial.left_out + (this.over?.left_out ?? 0);
    this.more.textContent = missing ? say("moreRows", { count: whole(missing) }) : "";
  }
}
