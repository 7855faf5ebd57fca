// Shapes for the drawing of the floor, independent of the trial.

// Returns the region around this one in the aspect ratio of the canvas.
function fitted(left, bottom, width, height, aspect) {
  const across = Math.max(width, height / aspect, CLOSEST);
  const up = across * aspect;
  return { left: left + (width - across) / 2, bottom: bottom + (height - up) / 2, width: across, height: up };
}

// Returns the start of a part so that it stays within the bounds; centred if it is longer than they are.
function within(begins, long, low, high) {
  return high - low < long ? (low + high - long) / 2 : Math.max(low, Math.min(begins, high - long));
}

// Returns for how many seconds of the trial a text is shown.
function lasting(speed) {
  return Math.max(0.9, 0.6 * speed);
}

// Returns the world position of a point of the robot, given to its right and forward.
function placed([x, y, heading], [right, forward]) {
  const angle = ((heading - 90) * Math.PI) / 180;
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  return [x + cosine * right - sine * forward, y + sine * right + cosine * forward];
}

function isMisread(image) {
  return image.truth !== undefined && image.answer !== image.truth;
}

function drawRay(context, forward, distance, scale) {
  const nothing = distance >= 2550;
  context.beginPath();
  context.setLineDash([6 / scale, 5 / scale]);
  context.moveTo(forward, 0);
  context.lineTo(forward + distance, 0);
  context.strokeStyle = nothing ? "rgba(63, 125, 60, 0.45)" : "rgba(63, 125, 60, 0.95)";
  context.lineWidth = 1.6 / scale;
  context.stroke();
  context.setLineDash([]);
  if (!nothing) dot(context, forward + distance, 0, 3.5 / scale, "#3f7d3c");
}

function drawWheel(context, body, side, degrees, thin) {
  const [length, width, spoke] = [body.wheel_diameter, body.wheel_diameter * 0.36, body.wheel_diameter / 5];
  const middle = (side * body.wheel_spacing) / 2;
  context.save();
  context.beginPath();
  context.roundRect(-length / 2, middle - width / 2, length, width, 4);
  context.fillStyle = COLOURS.ink;
  context.fill();
  context.clip();
  const rolled = (((degrees * Math.PI * body.wheel_diameter) / 360) % spoke + spoke) % spoke;
  context.beginPath();
  for (let x = -length / 2 + rolled; x < length / 2; x += spoke) {
    context.moveTo(x, middle - width / 2);
    context.lineTo(x, middle + width / 2);
  }
  context.strokeStyle = "rgba(255, 255, 255, 0.75)";
  context.lineWidth = 1.4 * thin;
  context.stroke();
  context.restore();
}

function drawBeacon(context, x, y) {
  context.beginPath();
  for (let point = 0; point < 10; point += 1) {
    const reach = point % 2 ? 4.5 : 11;
    const angle = (point * Math.PI) / 5 - Math.PI / 2;
    context.lineTo(x + reach * Math.cos(angle), y + reach * Math.sin(angle));
  }
  context.closePath();
  context.fillStyle = COLOURS.right;
  context.fill();
  context.strokeStyle = COLOURS.ink;
  context.lineWidth = 1;
  context.stroke();
}

function dot(context, x, y, radius, colour) {
  context.beginPath();
  context.arc(x, y, radius, 0, 7);
  context.fillStyle = colour;
  context.fill();
}

function diamond(context, x, y, radius, colour) {
  const reach = 1.3 * radius;
  context.beginPath();
  for (const [across, down] of [[0, -reach], [reach, 0], [0, reach], [-reach, 0]]) context.lineTo(x + across, y + down);
  context.closePath();
  context.fillStyle = colour;
  context.fill();
}

function cross(context, x, y, reach) {
  context.moveTo(x - reach, y - reach);
  context.lineTo(x + reach, y + reach);
  context.moveTo(x - reach, y + reach);
  context.lineTo(x + reach, y - reach);
}

// Draws a line that is visible on any floor.
function outlined(context, colour, width, path) {
  for (const [stroke, wide] of [[COLOURS.paper, width + 2.5], [colour, width]]) {
    context.beginPath();
    path();
    context.strokeStyle = stroke;
    context.lineWidth = wide;
    context.stroke();
  }
}

function written(context, text, x, y, colour, type = "12px") {
  context.font = `${type} ${FONT}`;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = colour;
  context.fillText(text, x, y + 0.5);
}

function label(context, text, x, y, colour) {
  context.font = `12px ${FONT}`;
  const width = context.measureText(text).width + 12;
  context.beginPath();
  context.roundRect(x - width / 2, y - 10, width, 20, 6);
  context.fillStyle = "rgba(255, 255, 255, 0.93)";
  context.fill();
  context.strokeStyle = colour;
  context.lineWidth = 1;
  context.stroke();
  written(context, text, x, y, colour);
}

function chip(context, text, x, y) {
  context.font = `bold 12px ${FONT}`;
  const half = Math.max(48, context.measureText(text).width / 2 + 8);
  const middle = Math.min(x, context.canvas.clientWidth - half - 10);
  context.beginPath();
  context.roundRect(middle - half, y - 12, 2 * half, 24, 12);
  context.fillStyle = COLOURS.left;
  context.fill();
  written(context, text, middle, y, COLOURS.paper, "bold 12px");
}

function shortened(context, text, width) {
  let shown = text.slice(0, 120);
  if (shown === text && context.measureText(shown).width <= width) return shown;
  while (shown && context.measureText(`${shown}…`).width > width) shown = shown.slice(0, -1);
  return `${shown}…`;
}

function rgb(light) {
  return `rgb(${light.map((value) => Math.round(value)).join(" ")})`;
}
