// The replay's data: unpacking, columns as numbers, and a robot's pose at a time.

const VERSION = 1;
const ALMOST = 1e-6;

// Returns a replay from its compressed bytes.
async function unpack(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const replay = JSON.parse(await new Response(stream).text());
  if (replay.version !== VERSION) throw new Error(say("version", { found: replay.version, expected: VERSION }));
  return replay;
}

function summedUp(column) {
  return column.added.map((steps) => {
    const values = new Float64Array(steps.length);
    let sum = 0;
    steps.forEach((step, row) => {
      if (step !== null) sum += step;
      values[row] = step === null ? NaN : sum / column.per;
    });
    return values;
  });
}

class RobotTrack {
  constructor(told) {
    Object.assign(this, { name: told.name, body: told.body, images: told.images, start: told.start, end: told.end });
    this.units = {};
    this.columns = {};
    for (const [name, column] of Object.entries(told.columns)) {
      this.units[name] = column.unit;
      this.columns[name] = summedUp(column);
    }
    this.length = this.columns.x ? this.columns.x[0].length : 0;
    this.pen = penDown(told.pen, this.length);
  }

  // Returns the pose [x, y, heading] after a number of ticks, which may be a fraction.
  pose(ticks) {
    if (!this.length) return ticks > 0 ? this.end : this.start;
    const whole = Math.max(0, Math.min(Math.floor(ticks + ALMOST), this.length));
    const before = this.row(whole);
    if (whole === this.length || ticks - whole < 1e-3) return before;
    const after = this.row(whole + 1);
    return before.map((value, part) => value + (after[part] - value) * (ticks - whole));
  }

  row(ticks) {
    if (ticks === 0) return this.start;
    const { x, y, heading } = this.columns;
    return [x[0][ticks - 1], y[0][ticks - 1], heading[0][ticks - 1]];
  }

  // Returns the values of a column after a number of ticks; empty if they are unknown.
  reading(name, ticks) {
    const parts = this.columns[name];
    if (!parts) return [];
    const row = Math.max(0, Math.min(Math.floor(ticks + ALMOST), this.length) - 1);
    return parts.map((values) => values[row]).filter((value) => !Number.isNaN(value));
  }
}

// Returns the ticks at which the pen goes down and up, as pairs.
function penDown(changes, length) {
  const strokes = [];
  let since = null;
  for (const [tick, down] of changes) {
    if (down && since === null) since = tick;
    if (!down && since !== null) {
      strokes.push([since, tick]);
      since = null;
    }
  }
  if (since !== null) strokes.push([since, length]);
  return strokes;
}

class Trial {
  constructor(told, floors) {
    Object.assign(this, told);
    this.robots = told.robots.map((robot) => new RobotTrack(robot));
    this.floorImage = floors[told.floor]?.loaded ?? null;
    this.over = told.over ? new Trial({ lost: [], ...told.over }, []) : null;
    const messages = told.messages.map((message) => ({ kind: "message", ...message }));
    this.happened = [...told.events, ...messages].sort((a, b) => a.t - b.t);
  }

  ticks(t) {
    const ticks = t / this.tick;
    return Math.abs(ticks - Math.round(ticks)) < 1e-3 ? Math.round(ticks) : ticks;
  }

  // Returns the number of entries of `happened` up to t.
  count(t) {
    let low = 0;
    let high = this.happened.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.happened[middle].t <= t + ALMOST) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

// Returns the last image that a robot sent up to t; null before the first.
function latestImage(robot, t) {
  let latest = null;
  for (const image of robot.images) {
    if (image.t > t + ALMOST) break;
    latest = image;
  }
  return latest;
}

function loadedImage(source) {
  return new Promise((resolve) => {
    if (!source) return resolve(null);
    const loaded = new Image();
    loaded.onload = () => resolve(loaded);
    loaded.onerror = () => resolve(null);
    loaded.src = source;
  });
}
