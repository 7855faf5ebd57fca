// The controls: one slider for one trial, by mouse, touch, keyboard and links.

const SPEEDS = [[0.25, "¼×"], [0.5, "½×"], [1, "1×"], [2, "2×"], [5, "5×"], [10, "10×"], [20, "20×"], [50, "50×"]];
const VIEWS = [["path", "path"], ["floor", "whole"], ["near", "near"]]; // mode and key of its text
const STEPS = { ArrowLeft: -0.1, ArrowRight: 0.1, ArrowDown: -1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
const REDUCED = window.matchMedia("(prefers-reduced-motion: reduce)");
const REDUCED_STEP = 500; // ms between two still images
const COPIED_FOR = 2000; // ms during which a link shows that it was copied

class ReplayControls {
  constructor(replay, root) {
    this.replay = replay;
    this.root = root;
    this.trials = replay.trials.map((trial) => new Trial(trial, replay.floors));
    this.t = 0;
    this.speed = 1;
    this.playing = false;
    const [sensors, ...beside] = [new SensorPanel(), new HappenedPanel(), new SourcePanel(replay.sources)];
    this.table = new EventTable();
    this.overChoice = new OverChoice(() => this.showOver());
    this.panels = [this.overChoice, sensors, ...beside];
    this.showingOver = [this.overChoice, beside[0], this.table]; // in addition to the floor
    this.build(sensors, beside);
    this.open(this.trials[replay.first], 0);
    this.listen();
  }

  build(sensors, beside) {
    const choice = (label, options) => {
      const select = element("select", {}, ...options.map(([value, text]) => element("option", { value }, text)));
      return [select, element("label", {}, element("span", {}, label), select)];
    };
    const [trial, trialLabel] = choice(say("trial"), this.trials.map((each) => [each.trial, `${each.name}: ${each.ended}`]));
    const [view, viewLabel] = choice(say("view"), VIEWS.map(([value, words]) => [value, say(words)]));
    const [speed, speedLabel] = choice(say("speed"), SPEEDS);
    speed.value = "1";
    Object.assign(this, { trialChoice: trial, viewChoice: view, speedChoice: speed });
    trialLabel.hidden = this.trials.length < 2;
    trialLabel.className = "trial-choice";
    this.canvas = element("canvas", { className: "floor", role: "img",
      "aria-label": say("floor") });
    this.floor = new FloorCanvas(this.canvas);
    this.play = element("button", { type: "button", className: "play" }, say("play"));
    this.slider = element("input", { type: "range", min: 0, step: "any", className: "moment", "aria-label": say("moment") });
    this.clock = element("span", { className: "clock" });
    this.link = element("a", { className: "small" }, say("link"));
    this.losses = element("ol", { className: "losses" });
    const main = element("div", { className: "main-part" }, this.canvas,
      element("div", { className: "controls" }, this.play, this.slider, this.clock),
      element("div", { className: "choices" }, speedLabel, viewLabel, this.link),
      element("p", { className: "small soft keys" }, say("keys")), this.losses, sensors.root);
    this.root.replaceChildren(trialLabel, this.overChoice.root, element("div", { className: "columns" }, main,
      element("div", { className: "panels" }, ...beside.map((panel) => panel.root))), this.table.root);
    const missing = this.replay.of - this.trials.length;
    if (missing) {
      this.root.append(element("p", { className: "small soft" },
        say("leftOut", { all: this.replay.of, missing })));
    }
  }

  listen() {
    this.play.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => this.seek(this.slider.valueAsNumber));
    this.speedChoice.addEventListener("change", () => { this.speed = Number(this.speedChoice.value); });
    this.viewChoice.addEventListener("change", () => {
      this.floor.mode = this.viewChoice.value;
      this.draw();
    });
    this.link.addEventListener("click", () => this.copyLink().catch(() => {}));
    this.trialChoice.addEventListener("change", () => this.open(this.byNumber(this.trialChoice.value), 0));
    this.root.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
  }

  byNumber(number) {
    return this.trials.find((trial) => trial.trial === Number(number));
  }

  open(trial, t) {
    this.trial = trial;
    this.trialChoice.value = String(trial.trial);
    const over = this.layOver();
    for (const panel of [...this.panels, this.table]) panel.show(trial, over);
    this.losses.replaceChildren(...trial.lost.map((loss) =>
      element("li", {}, element("b", {}, loss.title), ` (${loss.marks}), ${say("lostAt")} `, momentLink(trial, loss.t),
        element("p", { className: "small" }, loss.text))));
    this.seek(t);
  }

  // Sets the slider to the longer trial, and shows both on the floor.
  layOver() {
    const over = this.overChoice.of(this.trial);
    this.seconds = Math.max(this.trial.seconds, over ? over.seconds : 0);
    this.slider.max = String(this.seconds);
    this.floor.show(this.trial, over);
    return over;
  }

  showOver() {
    const over = this.layOver();
    for (const panel of this.showingOver) panel.show(this.trial, over);
    this.seek(this.t);
  }

  // Follows a link to a moment: #t=12.40, or #trial=2&t=12.40.
  follow(hash) {
    const asked = new URLSearchParams(hash.slice(1));
    const t = Number.parseFloat(asked.get("t") ?? "");
    if (!Number.isFinite(t)) return;
    const trial = asked.has("trial") ? this.byNumber(asked.get("trial")) : this.trial;
    if (!trial) return;
    this.pause();
    if (trial === this.trial) this.seek(t);
    else this.open(trial, t);
    this.root.scrollIntoView({ block: "start" });
    this.slider.focus({ preventScroll: true });
  }

  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target.closest("select, .lines, .scroll")) return;
    if (event.key === " " && !event.target.closest("button, a, summary, [type=checkbox]")) this.toggle();
    else if (event.key in STEPS) this.step(STEPS[event.key] * (event.shiftKey ? 10 : 1));
    else if (event.key === "Home") this.seek(0);
    else if (event.key === "End") this.seek(this.seconds);
    else return;
    event.preventDefault();
  }

  // Steps in tenths of a second, rounding the current time.
  step(by) {
    this.seek(Math.round((this.t + by) * 10) / 10);
  }

  seek(t) {
    this.t = Math.max(0, Math.min(t, this.seconds));
    this.draw();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.start();
  }

  start() {
    if (this.t >= this.seconds - ALMOST) this.seek(0);
    this.playing = true;
    this.play.textContent = say("pause");
    let last = performance.now();
    const frame = (now) => {
      if (!this.playing || !this.root.isConnected) return;
      if (!REDUCED.matches || now - last >= REDUCED_STEP) {
        this.seek(this.t + (Math.max(0, now - last) / 1000) * this.speed);
        last = now;
      }
      if (this.t >= this.seconds) this.pause();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.playing = false;
    this.play.textContent = say("play");
    this.tell();
  }

  draw() {
    this.slider.value = String(this.t);
    this.clock.textContent = this.clockWords();
    this.floor.draw(this.t, this.speed);
    for (const panel of this.panels) panel.draw(this.t);
    this.link.href = momentHash(this.trial, this.t);
    if (!this.playing) this.tell();
  }

  // Sets the screen reader text of the current time.
  tell() {
    const place = placeWords(this.trial.robots[0].pose(this.trial.ticks(this.t)));
    const count = this.trial.count(this.t);
    const latest = count ? happenedWords(this.trial.happened[count - 1]) : null;
    const said = latest ? `; ${say("last", { ...latest, text: latest.text.slice(0, 80) })}` : "";
    const over = this.overChoice.of(this.trial);
    const far = over ? `; ${over.name} ${apartWords(this.trial, this.t)}` : "";
    this.slider.setAttribute("aria-valuetext", `${this.clockWords()}; ${place}${far}${said}`);
  }

  // Copies the link if the browser allows it; otherwise it is in the address bar.
  async copyLink() {
    if (!navigator.clipboard) return;
    await navigator.clipboard.writeText(this.link.href);
    this.link.textContent = say("copied");
    setTimeout(() => { this.link.textContent = say("link"); }, COPIED_FOR);
  }

  clockWords() {
    return say("of", { seconds: this.t.toFixed(2), all: seconds(this.seconds) });
  }
}

// Shows an unpacked replay in an element. Returns its controls, or null if it has no trials.
async function showReplay(replay, root) {
  for (const floor of replay.floors) floor.loaded = await loadedImage(floor.image);
  return replay.trials.length ? new ReplayControls(replay, root) : null;
}
