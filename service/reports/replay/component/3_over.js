// The choice to overlay another trial, the time at which the two diverge, and their distance.

// Returns the distance between the robots of both trials, in mm and degrees.
function apart(trial, t) {
  const [[x, y, heading], [otherX, otherY, otherHeading]] = [trial, trial.over].map((run) =>
    run.robots[0].pose(run.ticks(t)));
  const turned = heading - otherHeading;
  return [Math.hypot(x - otherX, y - otherY), Math.abs(turned - 360 * Math.round(turned / 360))];
}

function apartWords(trial, t) {
  const [far, turned] = apart(trial, t);
  return say("apart", { far: Math.round(far), turned: Math.round(turned) });
}

class OverChoice {
  constructor(changed) {
    this.box = element("input", { type: "checkbox", checked: true });
    this.box.addEventListener("change", changed);
    this.words = element("span");
    this.parted = element("span", { className: "small" });
    this.now = element("span", { className: "small soft" });
    this.root = element("div", { className: "over" },
      element("label", {}, this.box, element("span", { className: "dashes", "aria-hidden": "true" }), this.words),
      this.parted, this.now);
  }

  // Returns the other trial if there is one and it is selected.
  of(trial) {
    return this.box.checked ? trial.over : null;
  }

  show(trial) {
    this.trial = trial;
    this.root.hidden = !trial.over;
    if (!trial.over) return;
    this.words.textContent = say("showOver", trial.over);
    const { parted } = trial.over;
    if (parted === null) this.parted.textContent = say("sameWay");
    else {
      this.parted.replaceChildren(
        element("a", { href: momentHash(trial, parted) }, say("part", { seconds: seconds(parted) })));
    }
    this.now.hidden = !this.box.checked;
  }

  draw(t) {
    if (!this.of(this.trial)) return;
    const words = say("now", { apart: apartWords(this.trial, t) });
    if (this.now.textContent !== words) this.now.textContent = words;
  }
}
