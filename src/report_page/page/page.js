// The page of a report: everything but the 3D view (view.js). Text from the data is only ever set as text.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);

// ---------------------------------------------------------------- helpers

const decoded = new Map();
// A block of numbers as a typed array.
function block(number, type) {
  if (!decoded.has(number)) {
    const text = atob(document.getElementById("block" + number).textContent);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    decoded.set(number, new type(bytes.buffer));
  }
  return decoded.get(number);
}

// element("p", {className: "soft"}, "text", child, ...)
function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key === "style") made.style.cssText = value;
    else made[key] = value;
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const byId = (id) => document.getElementById(id);
const whole = (n) => Math.round(n).toLocaleString("en-US");
const plural = (n, one, many = one + "s") => whole(n) + " " + (n === 1 ? one : many);
const percent = (share) => (share >= 0.9995 || share === 0 ? (100 * share).toFixed(0) : (100 * share).toFixed(1)) + " %";

// Three significant digits, without exponents where they can be avoided.
function short(value) {
  if (value === null || value === undefined || !isFinite(value)) return "not determined";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1000) return whole(value);
  if (size < 1e-4) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

function duration(seconds) {
  if (seconds < 1) return (1000 * seconds).toFixed(0) + " ms";
  if (seconds < 100) return seconds.toFixed(1) + " s";
  if (seconds < 6000) return (seconds / 60).toFixed(0) + " min";
  return (seconds / 3600).toFixed(1) + " h";
}

// Facts as a definition list; those that are null are left out.
function facts(list, entries) {
  list.replaceChildren();
  for (const [name, value] of entries) {
    if (value === null || value === undefined || value === "") continue;
    list.append(element("dt", {}, name), element("dd", {}, value));
  }
  return list;
}

// A check box with a colored label.
function checkbox(text, checked, color, changed) {
  const input = element("input", {type: "checkbox", checked});
  input.addEventListener("change", () => changed(input.checked));
  const swatch = color ? element("span", {className: "swatch", style: "background:" + color}) : null;
  return element("label", {}, input, swatch, text);
}

function chooser(text, options, changed) {
  const select = element("select");
  options.forEach(([value, label]) => select.append(element("option", {value}, label)));
  select.addEventListener("change", () => changed(select.value));
  return element("label", {}, text, select);
}

// ---------------------------------------------------------------- what the data means

const images = data.images.list;
const STATES = {
  in_use: ["in use", "#1c5d8c"],
  too_few_inliers: ["too few inliers", "#b9b4a6"],
  no_pose: ["no pose (turned without moving, or a plane)", "#8d8778"],
  triplet_inconsistent: ["loops of three do not close", "#e08e1b"],
  rotation_inconsistent: ["disagrees with the rotations", "#c8372d"],
  direction_inconsistent: ["disagrees with the positions", "#c04a9a"],
  other_component: ["not within one model", "#7fb2d6"],
  ambiguous: ["duplicate structure", "#7a3fa0"],
  model_inconsistent: ["the model contradicts it", "#7c1f1f"],
};
const stateText = (state) =>
  STATES[state] ? STATES[state][0] : state === "rejected_" ? "not verified" : "not verified: " + state.slice(9).replaceAll("_", " ");
const stateColor = (state) => (STATES[state] ? STATES[state][1] : "#e3dfd3");

// The pairs as columns of numbers.
const pairs = (() => {
  const source = data.pairs;
  const scaled = ({block: number, step}) => {
    const steps = block(number, Uint16Array);
    return (i) => (number === source.explained.block && steps[i] === 65535 ? null : steps[i] * step);
  };
  return {
    num: source.shown,
    image1: block(source.image1, Uint32Array),
    image2: block(source.image2, Uint32Array),
    state: block(source.state, Uint8Array),
    verifier: block(source.verifier, Uint8Array),
    inliers: block(source.inliers, Uint16Array),
    matches: block(source.matches, Uint16Array),
    residual: scaled(source.residual),
    angle: scaled(source.angle),
    time: scaled(source.time),
    explained: scaled(source.explained),
  };
})();
const pairState = (i) => data.pairs.states[pairs.state[i]];
const shown = {states: new Set(data.pairs.states), minInliers: 0};
const pairIsShown = (i) => shown.states.has(pairState(i)) && pairs.inliers[i] >= shown.minInliers;

const pictureUrls = new Map();
// A URL of a photo's thumbnail, or null.
function picture(image) {
  if (!pictureUrls.has(image)) {
    const ends = block(data.thumbnails.end, Uint32Array);
    const begin = image > 0 ? ends[image - 1] : 0;
    const bytes = block(data.thumbnails.bytes, Uint8Array).subarray(begin, ends[image]);
    pictureUrls.set(image, bytes.length > 0 ? URL.createObjectURL(new Blob([bytes], {type: "image/jpeg"})) : null);
  }
  return pictureUrls.get(image);
}

// ---------------------------------------------------------------- summary

function writeLead() {
  const registered = data.models.reduce((sum, model) => sum + model.images, 0);
  byId("title").textContent = data.title;
  const lead = byId("lead");
  if (data.models.length === 0) {
    lead.textContent = "No model came of " + plural(images.length, "photo") + ".";
    return;
  }
  const points = data.models.reduce((sum, model) => sum + model.points, 0);
  lead.textContent = whole(registered) + " of " + plural(images.length, "photo") + " in " + plural(data.models.length, "model") +
    (points > 0 ? " with " + plural(points, "point") + "." : ", cameras alone.");
}

function writeFindings() {
  const list = byId("findings");
  if (data.models.length > 0 && data.findings.length === 0) {
    list.append(element("li", {className: "good"}, element("p", {}, "No problem was found.")));
  }
  const titles = {wrong: "Wrong: ", doubtful: "Doubtful: ", note: ""};
  for (const finding of data.findings) {
    const item = element("li", {className: finding.level},
      element("p", {}, element("strong", {}, titles[finding.level]), finding.what + (/[.!?]$/.test(finding.what) ? "" : ".")));
    if (finding.advice) {
      const advice = finding.advice[0].toUpperCase() + finding.advice.slice(1);
      item.append(element("p", {className: "advice"}, advice + (/[.!?]$/.test(advice) ? "" : ".")));
    }
    if (finding.images.length > 0) item.append(photoNames(finding.images));
    list.append(item);
  }
}

// Names of photos, the first few at once.
function photoNames(list) {
  const first = 6;
  const text = (some) => some.map((image) => images[image].name).join(", ");
  if (list.length <= first) return element("p", {className: "names"}, text(list));
  return element("details", {className: "names"}, element("summary", {}, text(list.slice(0, first)) + " and " + (list.length - first) + " more"),
    element("p", {}, text(list.slice(first))));
}

function sureness(model) {
  if (model.explained === null) return null;
  const share = percent(model.explained) + " of the verified matches of its photos agree with it";
  return model.contradicted_pairs > 0 ? share + "; it contradicts " + whole(model.contradicted_pairs) + " of " + plural(model.pairs, "pair") : share;
}

function writeModels() {
  for (const model of data.models) {
    const list = facts(element("dl"), [
      ["points", model.points > 0 ? whole(model.points) + ", each seen by " + model.track_length.toFixed(1) + " photos" : "none"],
      ["error", model.points > 0 ? model.error_px.toFixed(3) + " px (mean reprojection error)" : null],
      ["how sure", sureness(model)],
      ["poses", model.rotation_sigma_deg === null ? null : "known to " + short(model.rotation_sigma_deg) + "° and " +
        short(100 * model.position_sigma) + " % of the cameras' spread (median standard deviation)"],
    ]);
    byId("models").append(element("div", {className: "card"}, element("div", {className: "soft"}, model.name),
      element("div", {className: "big"}, plural(model.images, "photo")), list));
  }
}

// ---------------------------------------------------------------- view graph: matrix

const orders = {
  structure: data.images.order,
  model: data.images.order.slice().sort((a, b) => (images[a].model + 1 || 1e9) - (images[b].model + 1 || 1e9)),
  name: images.map((_, i) => i).sort((a, b) => (images[a].name < images[b].name ? -1 : images[a].name > images[b].name ? 1 : 0)),
};
const matrix = {order: orders.structure, zoom: 1, chosen: -1, cell: 1};

function positionsOf(order) {
  const positions = new Uint32Array(order.length);
  order.forEach((image, position) => (positions[image] = position));
  return positions;
}

// A color laid over white, as a pixel of ImageData seen as one number.
function pixelOf(color, alpha) {
  const over = (k) => Math.round(255 + alpha * (parseInt(color.slice(1 + 2 * k, 3 + 2 * k), 16) - 255));
  return (255 << 24) | (over(2) << 16) | (over(1) << 8) | over(0);
}

// Pixels, not rectangles of the canvas: there may be hundreds of thousands.
function drawMatrix() {
  const canvas = byId("matrix");
  const num = Math.max(1, images.length);
  const size = Math.min(4096, Math.max(200, Math.floor((byId("matrix-frame").clientWidth || 600) * matrix.zoom)));
  matrix.cell = size / num;
  canvas.width = canvas.height = size;
  canvas.style.width = canvas.style.height = size + "px";
  const context = canvas.getContext("2d");
  const picture = context.createImageData(size, size), pixels = new Uint32Array(picture.data.buffer).fill(0xffffffff);
  const positions = positionsOf(matrix.order);
  const gap = matrix.cell > 6 ? 1 : 0;
  const rank = data.pairs.states.map((state) => (state === "in_use" ? 2 : STATES[state] ? 1 : 0));
  // In steps of an eighth, so that colors are computed once.
  const colors = data.pairs.states.map((state, k) => Array.from({length: 9}, (_, step) => pixelOf(stateColor(state), rank[k] === 0 ? 1 : 0.3 + 0.7 * step / 8)));
  const fill = (column, row, color) => {
    const left = Math.floor(column * matrix.cell), top = Math.floor(row * matrix.cell);
    const right = Math.max(left + 1, Math.floor((column + 1) * matrix.cell) - gap), bottom = Math.max(top + 1, Math.floor((row + 1) * matrix.cell) - gap);
    for (let y = top; y < bottom; ++y) pixels.fill(color, y * size + left, y * size + right);
  };
  // What matters most is drawn last: rejected pairs, removed ones, those in use.
  for (const layer of [0, 1, 2]) {
    for (let i = 0; i < pairs.num; ++i) {
      if (rank[pairs.state[i]] !== layer || !pairIsShown(i)) continue;
      const color = colors[pairs.state[i]][Math.round(8 * Math.min(1, Math.log1p(pairs.inliers[i]) / 6.2))];
      const a = positions[pairs.image1[i]], b = positions[pairs.image2[i]];
      fill(a, b, color);
      fill(b, a, color);
    }
  }
  context.putImageData(picture, 0, 0);
  markChosen(context, positions);
}

function markChosen(context, positions) {
  if (matrix.chosen < 0) return;
  const x = positions[pairs.image1[matrix.chosen]] * matrix.cell, y = positions[pairs.image2[matrix.chosen]] * matrix.cell;
  const side = Math.max(7, matrix.cell + 4), shift = (side - matrix.cell) / 2;
  context.strokeStyle = "#111";
  context.lineWidth = 2;
  context.strokeRect(x - shift, y - shift, side, side);
  context.strokeRect(y - shift, x - shift, side, side);
}

// The shown pair nearest to a place of the matrix, within some pixels, or -1.
function pairAt(x, y) {
  const positions = positionsOf(matrix.order);
  const reach = Math.max(8, matrix.cell);
  let best = -1, bestDistance = reach * reach;
  for (let i = 0; i < pairs.num; ++i) {
    if (!pairIsShown(i)) continue;
    const a = (positions[pairs.image1[i]] + 0.5) * matrix.cell, b = (positions[pairs.image2[i]] + 0.5) * matrix.cell;
    const distance = Math.min((a - x) ** 2 + (b - y) ** 2, (b - x) ** 2 + (a - y) ** 2);
    if (distance < bestDistance) [best, bestDistance] = [i, distance];
  }
  return best;
}

function filterChanged() {
  drawMatrix();
  writePairList();
  document.dispatchEvent(new Event("filter"));
}

// A check box a state, with how many pairs have it. `set` holds the states that are shown.
function stateBoxes(set, states, changed) {
  return states.map((state) => checkbox(stateText(state) + " (" + whole(data.pairs.counts[state] ?? 0) + ")", set.has(state), stateColor(state),
    (on) => {
      on ? set.add(state) : set.delete(state);
      changed();
    }));
}

function slider(changed) {
  const value = element("output", {}, "0");
  const input = element("input", {type: "range", min: 0, max: 100, value: 0});
  input.addEventListener("input", () => {
    const inliers = input.value === "0" ? 0 : Math.round(10 ** (input.value / 25));
    value.textContent = inliers;
    changed(inliers);
  });
  return element("label", {}, "at least", value, "inliers", input);
}

function writeGraph() {
  const inUse = data.pairs.counts.in_use ?? 0;
  const verified = Object.entries(data.pairs.counts).filter(([state]) => STATES[state]).reduce((sum, [, n]) => sum + n, 0);
  byId("graph-text").textContent = plural(inUse, "pair") + " in use of " + whole(verified) + " verified and " + whole(data.pairs.total) + " tried." +
    (data.pairs.shown < data.pairs.total ? " The " + whole(data.pairs.shown) + " with the most inliers are in this file." : "");
  byId("matrix-controls").append(
    chooser("order by", [["structure", "structure"], ["model", "model"], ["name", "name"]], (value) => {
      matrix.order = orders[value];
      drawMatrix();
    }),
    chooser("zoom", [[1, "1×"], [2, "2×"], [4, "4×"], [8, "8×"]], (value) => {
      matrix.zoom = Number(value);
      drawMatrix();
    }),
    slider((inliers) => {
      shown.minInliers = inliers;
      filterChanged();
    }));
  byId("states").append(...stateBoxes(shown.states, data.pairs.states.filter((state) => data.pairs.counts[state]), filterChanged));
  byId("matrix").addEventListener("click", (event) => {
    const found = pairAt(event.offsetX, event.offsetY);
    if (found >= 0) choosePair(found);
  });
  addEventListener("resize", drawMatrix);
  drawMatrix();
  writePairList();
}

// ---------------------------------------------------------------- view graph: a pair

const pairView = {inliers: true, rejected: true};

// Both photos, beside each other or, on a narrow page, below each other, and the lines between them.
function layoutPair(pictures, width) {
  const isNarrow = width < 480;
  const ratios = pictures.map((p) => (p ? p.height / p.width : 0.75));
  if (isNarrow) {
    return {height: width * (ratios[0] + ratios[1]) + 6,
            boxes: [[0, 0, width, width * ratios[0]], [0, width * ratios[0] + 6, width, width * ratios[1]]]};
  }
  const half = (width - 6) / 2;
  return {height: half * Math.max(...ratios), boxes: [[0, 0, half, half * ratios[0]], [half + 6, 0, half, half * ratios[1]]]};
}

function loadPicture(image) {
  const url = picture(image);
  if (!url) return Promise.resolve(null);
  return new Promise((resolve) => {
    const made = new Image();
    made.onload = () => resolve(made);
    made.onerror = () => resolve(null);
    made.src = url;
  });
}

function drawLines(context, boxes, from, to, color) {
  const xyxy = block(data.pairs.drawn.xyxy, Uint16Array);
  context.strokeStyle = context.fillStyle = color;
  for (let m = from; m < to; ++m) {
    const at = (box, k) => [box[0] + xyxy[4 * m + k] / 65535 * box[2], box[1] + xyxy[4 * m + k + 1] / 65535 * box[3]];
    const [x1, y1] = at(boxes[0], 0), [x2, y2] = at(boxes[1], 2);
    context.beginPath();
    context.moveTo(x1, y1);
    context.lineTo(x2, y2);
    context.stroke();
    context.fillRect(x1 - 1.5, y1 - 1.5, 3, 3);
    context.fillRect(x2 - 1.5, y2 - 1.5, 3, 3);
  }
}

async function drawPair() {
  const i = matrix.chosen;
  if (i < 0) return;
  const pictures = await Promise.all([loadPicture(pairs.image1[i]), loadPicture(pairs.image2[i])]);
  if (i !== matrix.chosen) return;  // another one was chosen meanwhile
  const canvas = byId("pair-canvas");
  const width = byId("pair-frame").clientWidth || 600;
  const {height, boxes} = layoutPair(pictures, width);
  const scale = Math.min(2, devicePixelRatio || 1);
  canvas.width = width * scale;
  canvas.height = height * scale;
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  pictures.forEach((p, k) => {
    context.fillStyle = "#eceae3";
    context.fillRect(...boxes[k]);
    if (p) context.drawImage(p, ...boxes[k]);
  });
  const ends = block(data.pairs.drawn.end, Uint32Array);
  const first = i > 0 ? ends[i - 1] : 0;
  const middle = first + block(data.pairs.drawn.num_inliers, Uint16Array)[i];
  context.lineWidth = 0.6;
  context.globalAlpha = 0.6;
  if (pairView.rejected) drawLines(context, boxes, middle, ends[i], "#e0402f");
  if (pairView.inliers) drawLines(context, boxes, first, middle, "#1fb36b");
  canvas.dataset.drawn = String(i);
}

function writePairFacts(i) {
  const ends = block(data.pairs.drawn.end, Uint32Array);
  const drawn = ends[i] - (i > 0 ? ends[i - 1] : 0);
  byId("pair-title").textContent = images[pairs.image1[i]].name + "  –  " + images[pairs.image2[i]].name;
  const explained = pairs.explained(i);
  facts(byId("pair-facts"), [
    ["state", stateText(pairState(i))],
    ["matches", whole(pairs.matches[i]) + ", of these " + whole(pairs.inliers[i]) + " inliers" +
      (drawn < pairs.matches[i] ? " (" + (drawn > 0 ? whole(drawn) + " drawn" : "none in this file") + ")" : "")],
    ["the model explains", explained === null ? null : percent(explained) + " of the inliers"],
    ["verifier", data.pairs.verifiers[pairs.verifier[i]].replaceAll("_", " ")],
    ["time", pairs.time(i) > 0 ? pairs.time(i).toFixed(2) + " ms" : null],
    ["residual", pairs.residual(i) > 0 ? pairs.residual(i).toFixed(3) + " px (median Sampson error)" : null],
    ["triangulation angle", pairs.angle(i) > 0 ? pairs.angle(i).toFixed(2) + "° (median)" : null],
  ]);
}

function choosePair(i) {
  matrix.chosen = i;
  writePairFacts(i);
  drawMatrix();
  for (const row of byId("pair-list").querySelectorAll("tr")) row.classList.toggle("chosen", row.dataset.pair === String(i));
  return drawPair();
}

// The shown pairs, by inliers.
function sortedPairs() {
  const list = [];
  for (let i = 0; i < pairs.num; ++i) if (pairIsShown(i)) list.push(i);
  return list.sort((a, b) => pairs.inliers[b] - pairs.inliers[a] || a - b);
}

function writePairList() {
  const maxRows = 300;
  const body = element("tbody");
  for (const i of sortedPairs().slice(0, maxRows)) {
    const row = element("tr", {tabIndex: 0}, element("td", {}, images[pairs.image1[i]].name), element("td", {}, images[pairs.image2[i]].name),
      element("td", {className: "number"}, whole(pairs.inliers[i])),
      element("td", {}, element("span", {className: "swatch", style: "background:" + stateColor(pairState(i))}), " " + stateText(pairState(i))));
    row.dataset.pair = i;
    row.addEventListener("click", () => choosePair(i));
    row.addEventListener("keydown", (event) => event.key === "Enter" && choosePair(i));
    body.append(row);
  }
  const head = element("tr", {}, element("th", {}, "photo"), element("th", {}, "photo"), element("th", {className: "number"}, "inliers"), element("th", {}, "state"));
  byId("pair-list").replaceChildren(element("table", {}, element("thead", {}, head), body));
}

function stepPair(step) {
  const list = sortedPairs();
  if (list.length === 0) return;
  const at = list.indexOf(matrix.chosen);
  choosePair(list[at < 0 ? 0 : (at + step + list.length) % list.length]);
}

function writePair() {
  const button = (text, step) => {
    const made = element("button", {}, text);
    made.addEventListener("click", () => stepPair(step));
    return made;
  };
  byId("pair-controls").append(button("← previous", -1), button("next →", 1),
    checkbox("inliers", true, "#1fb36b", (on) => { pairView.inliers = on; drawPair(); }),
    checkbox("rejected matches", true, "#e0402f", (on) => { pairView.rejected = on; drawPair(); }));
  addEventListener("resize", drawPair);
  if (pairs.num > 0) choosePair(sortedPairs()[0]);
  else byId("pair").hidden = true;
}

// ---------------------------------------------------------------- figures

function svg(name, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function histogram(h) {
  const width = 330, height = 150, left = 6, bottom = 20, top = 8;
  const most = Math.max(...h.counts, 1);
  const bar = (width - 2 * left) / h.counts.length;
  const chart = svg("svg", {viewBox: `0 0 ${width} ${height}`, role: "img"});
  h.counts.forEach((count, i) => {
    const size = count / most * (height - bottom - top);
    const from = h.lowest + i * h.width;
    const isLast = i === h.counts.length - 1 && h.is_cut;
    const label = short(from) + (isLast ? " and more" : " to " + short(from + h.width)) + " " + h.unit + ": " + whole(count);
    chart.append(svg("rect", {x: left + i * bar, y: height - bottom - size, width: Math.max(0.5, bar - 1), height: size, fill: isLast ? "#8fb0c6" : "#1c5d8c"},
      svg("title", {}, label)));
  });
  chart.append(svg("line", {x1: left, x2: width - left, y1: height - bottom + 0.5, y2: height - bottom + 0.5, stroke: "#dcdad2"}));
  const label = (x, anchor, text) => chart.append(svg("text", {x, y: height - 6, "text-anchor": anchor}, text));
  label(left, "start", short(h.lowest));
  label(width / 2, "middle", h.unit);
  label(width - left, "end", short(h.lowest + h.counts.length * h.width) + (h.is_cut ? "+" : ""));
  return element("figure", {className: "card"}, element("h3", {}, h.title), chart,
    element("figcaption", {className: "soft"}, whole(h.num) + "; median " + short(h.median) + " " + h.unit + ", largest " + short(h.largest) + " " + h.unit));
}

// ---------------------------------------------------------------- cameras

// An arrow a cell over the root mean square residual as a shade.
function residualMap(camera) {
  const {columns, rows} = camera.map;
  const get = (key) => block(camera.map[key], Float32Array);
  const count = get("count"), dx = get("dx"), dy = get("dy"), rms = get("rms");
  const canvas = element("canvas", {width: 960, height: Math.round(960 * rows / columns)});
  const cell = canvas.width / columns;
  canvas.style.maxWidth = "calc(34rem * " + (columns / rows) + ")";
  const context = canvas.getContext("2d");
  const isKnown = (i) => count[i] >= 5;  // fewer say nothing about the lens
  const known = [...count.keys()].filter(isKnown);
  const sorted = (values) => known.map(values).sort((a, b) => a - b);
  const high = (list) => list[Math.floor(0.95 * (list.length - 1))] || 1e-9;
  const mostRms = high(sorted((i) => rms[i])), mostMean = high(sorted((i) => Math.hypot(dx[i], dy[i])));
  context.fillStyle = "#f4f2ec";
  context.fillRect(0, 0, canvas.width, canvas.height);
  for (const i of known) {
    const x = (i % columns) * cell, y = Math.floor(i / columns) * cell;
    const shade = Math.min(1, rms[i] / mostRms);
    context.fillStyle = `rgb(${Math.round(255 - 25 * shade)} ${Math.round(252 - 55 * shade)} ${Math.round(244 - 104 * shade)})`;
    context.fillRect(x, y, cell, cell);
  }
  const scale = 0.9 * cell / mostMean;
  context.strokeStyle = context.fillStyle = "#1c3d5a";
  context.lineWidth = 2.2;
  for (const i of known) {
    const x = (i % columns + 0.5) * cell, y = (Math.floor(i / columns) + 0.5) * cell;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + Math.max(-1.5, Math.min(1.5, dx[i] / mostMean)) * 0.9 * cell, y + Math.max(-1.5, Math.min(1.5, dy[i] / mostMean)) * 0.9 * cell);
    context.stroke();
    context.fillRect(x - 2.5, y - 2.5, 5, 5);
  }
  return {canvas, text: known.length === 0 ? "too few observations" :
    "an arrow of one cell is " + short(cell / scale) + " px; the darkest shade is " + short(mostRms) + " px"};
}

function cameraFacts(camera) {
  return [
    ["model", camera.model + " " + camera.width + " × " + camera.height],
    ["focal length", camera.focal_px ? camera.focal_px.toFixed(1) + " px; " + camera.origin +
      (camera.focal_before_px && Math.abs(camera.focal_px - camera.focal_before_px) > 0.05 ? ", before " + camera.focal_before_px.toFixed(1) + " px" : "") : null],
    ["parameters", camera.params.map(short).join(", ")],
    ["photos", whole(camera.images)],
    ["doubt", camera.doubt],
  ];
}

function writeCameras() {
  const grid = byId("lenses");
  for (const camera of data.cameras) {
    if (!camera.map) continue;
    const {canvas, text} = residualMap(camera);
    grid.append(element("figure", {className: "card"}, element("h3", {}, "camera " + camera.id), canvas,
      element("figcaption", {}, element("p", {className: "soft"}, text), facts(element("dl"), cameraFacts(camera)))));
  }
  if (!grid.children.length) grid.append(element("p", {className: "soft"}, "There are no observations of points."));
  const body = element("tbody");
  for (const camera of data.cameras) {
    body.append(element("tr", {}, element("td", {}, String(camera.id)), ...cameraFacts(camera).map(([, value]) => element("td", {}, value ?? ""))));
  }
  const head = element("tr", {}, ...["camera", "model", "focal length", "parameters", "photos", "doubt"].map((text) => element("th", {}, text)));
  byId("camera-table").append(element("div", {className: "scroll"}, element("table", {}, element("thead", {}, head), body)));
}

// ---------------------------------------------------------------- stages

// Stages of one name in a row, each run of them as a bar at its time.
function timeRow(name, runs, total) {
  const seconds = runs.reduce((sum, run) => sum + run.stage.seconds, 0);
  const bars = runs.map(({stage, begin}) => element("i", {className: stage.status, title: duration(stage.seconds),
    style: `left:${100 * begin / total}%;width:${100 * stage.seconds / total}%`}));
  return element("div", {className: "stage"}, element("span", {}, name.replaceAll("_", " ") + (runs.length > 1 ? " × " + runs.length : "")),
    element("span", {className: "bar"}, ...bars), element("span", {className: "time"}, duration(seconds)));
}

// Memory after each stage, over time.
function memoryRow(runs, total) {
  const known = runs.filter(({stage}) => stage.memory_gib);
  if (known.length === 0) return null;
  const most = Math.max(...known.map(({stage}) => stage.memory_gib));
  const points = known.map(({stage, begin}) => (1000 * (begin + stage.seconds) / total).toFixed(1) + "," + (38 - 34 * stage.memory_gib / most).toFixed(1));
  const chart = svg("svg", {viewBox: "0 0 1000 40", preserveAspectRatio: "none"},
    svg("polygon", {points: "0,40 0," + points[0].split(",")[1] + " " + points.join(" ") + " 1000,40", fill: "#cfdde7"}));
  return element("div", {className: "stage"}, element("span", {}, "memory"), element("span", {className: "bar memory"}, chart),
    element("span", {className: "time"}, "up to " + most.toFixed(2) + " GiB"));
}

// Everything that a stage said.
function stageDetails(stage) {
  const values = Object.entries(stage.values ?? {}).map(([key, value]) => key.replaceAll("_", " ") + " " + short(value));
  const row = element("div", {className: "said"}, element("strong", {}, stage.name.replaceAll("_", " ")),
    " " + duration(stage.seconds) + (stage.memory_gib ? ", " + stage.memory_gib.toFixed(2) + " GiB" : "") + (stage.status === "ok" ? "" : " (" + stage.status + ")"),
    element("div", {className: "soft"}, values.join(", ")));
  if (stage.messages) row.append(element("ul", {}, ...stage.messages.map((text) => element("li", {}, text))));
  return row;
}

// When each stage began, taken one after the other. Small parts of a scene are built side by side: their stages are stretched into
// the time that all of them took (the stage "parts").
function stagesInTime(report) {
  const ofParts = (stage) => stage.values?.side_by_side;
  const seconds = (stages) => stages.reduce((sum, stage) => sum + stage.seconds, 0);
  const sideBySide = seconds(report.stages.filter((stage) => stage.name === "parts"));
  const scale = sideBySide > 0 ? Math.min(1, sideBySide / Math.max(1e-9, seconds(report.stages.filter(ofParts)))) : 1;
  const runs = [];
  let begin = 0;
  for (const stage of report.stages) {
    if (stage.name === "parts") continue;
    runs.push({stage, begin});
    begin += stage.seconds * (ofParts(stage) ? scale : 1);
  }
  return {runs, total: Math.max(1e-9, begin)};
}

function timeline(report) {
  const {runs, total} = stagesInTime(report);
  const names = [...new Set(report.stages.map((stage) => stage.name))];
  const peak = report.values?.peak_memory_gib;
  const warned = report.stages.filter((stage) => stage.status !== "ok" && stage.status !== "skipped" && stage.messages);
  return element("div", {className: "run"}, element("h3", {}, report.program),
    element("p", {className: "soft"}, duration(report.values?.seconds ?? total) + (peak ? ", at most " + peak.toFixed(2) + " GiB" : "")),
    ...names.map((name) => timeRow(name, runs.filter((run) => run.stage.name === name), total)), memoryRow(runs, total),
    warned.length > 0 ? element("ul", {className: "warned"}, ...warned.flatMap((stage) => stage.messages.map((text) => element("li", {}, stage.name.replaceAll("_", " ") + ": " + text)))) : null,
    element("details", {}, element("summary", {}, "All " + plural(runs.length, "stage") + " with their figures"), ...report.stages.map(stageDetails)));
}

function writeStages() {
  const reports = [data.build, data.run].filter((report) => report && Array.isArray(report.stages));
  byId("timeline").append(...reports.map(timeline));
  if (reports.length === 0) byId("timeline").append(element("p", {className: "soft"}, "There is no report.json beside the model."));
}

// ---------------------------------------------------------------- photos

const photos = {filter: "all", num: 60};

function photoCard(i) {
  const image = images[i];
  const lines = image.model >= 0
    ? [data.models[image.model].name + ", " + plural(image.points, "point"), short(image.error_px) + " px, " + plural(image.pairs, "pair"),
       image.explained === undefined ? "" : percent(image.explained) + " explained"]
    : ["in no model: " + image.reason];
  const box = element("img", {className: "picture", alt: "", loading: "lazy"});
  const url = picture(i);
  if (url) box.src = url;
  box.addEventListener("click", () => document.dispatchEvent(new CustomEvent("fly", {detail: i})));
  return element("figure", {className: "photo" + (image.model < 0 ? " out" : "")}, url ? box : element("div", {className: "picture"}),
    element("figcaption", {}, element("strong", {}, image.name), ...lines.filter(Boolean).map((line) => element("div", {className: "soft"}, line))));
}

function writePhotos() {
  const chosen = images.map((_, i) => i).filter((i) => photos.filter === "all" || String(images[i].model) === photos.filter);
  chosen.sort((a, b) => (images[a].model < 0 ? 0 : 1) - (images[b].model < 0 ? 0 : 1) || a - b);
  byId("photo-grid").replaceChildren(...chosen.slice(0, photos.num).map(photoCard));
  const rest = chosen.length - photos.num;
  byId("photo-more").replaceChildren();
  if (rest <= 0) return;
  const more = element("button", {}, "show " + whole(rest) + " more");
  more.addEventListener("click", () => {
    photos.num = Infinity;
    writePhotos();
  });
  byId("photo-more").append(more);
}

function writePhotoControls() {
  const options = [["all", "all " + whole(images.length)]];
  const out = images.filter((image) => image.model < 0).length;
  if (out > 0) options.push(["-1", "in no model (" + whole(out) + ")"]);
  data.models.forEach((model, k) => options.push([String(k), model.name + " (" + whole(model.images) + ")"]));
  byId("photo-controls").append(chooser("show", options, (value) => {
    photos.filter = value;
    writePhotos();
  }));
}

// ---------------------------------------------------------------- all of it

writeLead();
writeFindings();
writeModels();
writeGraph();
writePair();
byId("histograms").append(...data.histograms.map(histogram));
if (data.histograms.length === 0) byId("figures").hidden = true;
writeCameras();
writeStages();
writePhotoControls();
writePhotos();
byId("foot").textContent = "Written by cairn. This file holds all it shows and needs no network.";
