// The 3D view: points, cameras as frusta, edges of the view graph. Drawn only when something changed.
"use strict";

(() => {
  const models = data.models;
  if (models.length === 0) {
    byId("scene").hidden = true;
    return;
  }
  const missing = (text) => {
    byId("scene-body").hidden = true;
    byId("scene-missing").hidden = false;
    byId("scene-missing").textContent = text;
  };
  if (typeof THREE === "undefined" || !THREE.OrbitControls) {
    missing("The 3D view needs three.js, which was not in " + data.three_folder +
      " when this report was made. Install Debian's package libjs-three (sudo apt install libjs-three) and run global_sfm report again.");
    return;
  }

  const poses = block(data.images.poses, Float32Array);
  const canvas = byId("view-canvas");
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({canvas, antialias: true, preserveDrawingBuffer: true});
  } catch (error) {
    missing("This browser has no WebGL, which the 3D view needs.");
    return;
  }
  renderer.setPixelRatio(Math.min(2, devicePixelRatio || 1));
  renderer.setClearColor(0xffffff);
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera(50, 1, 0.001, 1000);
  const controls = new THREE.OrbitControls(camera, canvas);
  const view = {camera, model: 0, points: null, frusta: null, edges: null, centers: [], indices: [], size: 2, frustum: 0.05, scale: 1};
  const edgeStates = {states: new Set(), minInliers: 0};

  // ---- frame of a model: the world in which three.js shows it has y up, the cameras' median at its middle, radius 1.

  const rotationOf = (i) => poses.subarray(12 * i, 12 * i + 9);
  const centerOf = (i) => new THREE.Vector3(poses[12 * i + 9], poses[12 * i + 10], poses[12 * i + 11]);
  // A direction of the camera's frame in the world: columns of the transposed rotation.
  const axisOf = (i, axis) => new THREE.Vector3(...rotationOf(i).subarray(3 * axis, 3 * axis + 3));

  const median = (values) => values.slice().sort((a, b) => a - b)[values.length >> 1];

  function frameOf(indices, xyz) {
    const up = new THREE.Vector3();
    indices.forEach((i) => up.sub(axisOf(i, 1)));  // the image's y points down
    if (up.length() < 1e-6) up.set(0, -1, 0);
    const samples = [0, 1, 2].map((k) => {
      const list = indices.map((i) => poses[12 * i + 9 + k]);
      const step = Math.max(1, Math.floor(xyz.length / 3 / 2000));
      for (let p = 0; p < xyz.length / 3; p += step) list.push(xyz[3 * p + k]);
      return list;
    });
    const middle = new THREE.Vector3(...samples.map(median));
    const distances = samples[0].map((_, s) => Math.hypot(samples[0][s] - middle.x, samples[1][s] - middle.y, samples[2][s] - middle.z));
    const radius = distances.sort((a, b) => a - b)[Math.floor(0.75 * (distances.length - 1))] || 1;
    const turn = new THREE.Quaternion().setFromUnitVectors(up.normalize(), new THREE.Vector3(0, 1, 0));
    return {middle, radius, turn};
  }

  const toView = (point) => point.clone().sub(view.frame.middle).divideScalar(view.frame.radius).applyQuaternion(view.frame.turn);
  const toViewDirection = (direction) => direction.clone().applyQuaternion(view.frame.turn);

  // ---- what is drawn

  function lines(positions, colors, opacity) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(positions), 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(colors), 3));
    const material = new THREE.LineBasicMaterial({vertexColors: THREE.VertexColors, transparent: opacity < 1, opacity});
    return new THREE.LineSegments(geometry, material);
  }

  function replace(name, object) {
    if (view[name]) {
      if (object) object.visible = view[name].visible;
      scene.remove(view[name]);
      view[name].geometry.dispose();
      view[name].material.dispose();
    }
    view[name] = object;
    if (object) scene.add(object);
  }

  function makePoints(model) {
    const xyz = block(model.xyz, Float32Array), rgb = block(model.rgb, Uint8Array);
    const positions = new Float32Array(xyz.length);
    const point = new THREE.Vector3();
    for (let i = 0; i < xyz.length; i += 3) {
      point.set(xyz[i], xyz[i + 1], xyz[i + 2]).sub(view.frame.middle).divideScalar(view.frame.radius).applyQuaternion(view.frame.turn);
      positions[i] = point.x;
      positions[i + 1] = point.y;
      positions[i + 2] = point.z;
    }
    // A model without the colors of photographs is black: drawn in gray.
    const isBlack = rgb.every((value) => value === 0);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(rgb, 3, true));
    const options = {size: view.pointSize || view.size, sizeAttenuation: false};
    if (isBlack) options.color = 0x55606a;
    else options.vertexColors = THREE.VertexColors;
    replace("points", new THREE.Points(geometry, new THREE.PointsMaterial(options)));
  }

  // The corners of what a camera sees, in its own frame, at unit distance.
  function corners(i) {
    const of = data.cameras[images[i].camera];
    const focal = of.focal_px || of.width;
    const x = Math.min(2, of.width / 2 / focal), y = Math.min(2, of.height / 2 / focal);
    return [[-x, -y], [x, -y], [x, y], [-x, y]];
  }

  function makeFrusta() {
    const positions = [], colors = [];
    view.centers = [];
    for (const i of view.indices) {
      const center = toView(centerOf(i));
      view.centers.push(center);
      const axes = [0, 1, 2].map((axis) => toViewDirection(axisOf(i, axis)));
      const size = view.frustum * view.scale;
      const ends = corners(i).map(([x, y]) => center.clone().addScaledVector(axes[0], x * size).addScaledVector(axes[1], y * size).addScaledVector(axes[2], size));
      const color = [0.75, 0.16, 0.12];
      const add = (a, b) => {
        positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
        colors.push(...color, ...color);
      };
      ends.forEach((end, k) => {
        add(center, end);
        add(end, ends[(k + 1) % 4]);
      });
    }
    replace("frusta", lines(positions, colors, 1));
  }

  function makeEdges() {
    const positions = [], colors = [];
    const color = new THREE.Color();
    for (let p = 0; p < pairs.num; ++p) {
      const state = pairState(p);
      if (!edgeStates.states.has(state) || pairs.inliers[p] < edgeStates.minInliers) continue;
      const a = pairs.image1[p], b = pairs.image2[p];
      if (images[a].model !== view.model || images[b].model !== view.model) continue;
      const from = toView(centerOf(a)), to = toView(centerOf(b));
      // Weak pairs are paler.
      color.set(stateColor(state)).lerp(new THREE.Color(0xffffff), 0.75 * (1 - Math.min(1, Math.log1p(pairs.inliers[p]) / 6.2)));
      positions.push(from.x, from.y, from.z, to.x, to.y, to.z);
      colors.push(color.r, color.g, color.b, color.r, color.g, color.b);
    }
    replace("edges", lines(positions, colors, 0.8));
  }

  // ---- camera of the viewer

  let wanted = false;
  function draw() {
    if (wanted) return;
    wanted = true;
    requestAnimationFrame(() => {
      wanted = false;
      renderer.render(scene, camera);
    });
  }

  function resize() {
    const box = byId("view");
    renderer.setSize(box.clientWidth, box.clientHeight, false);
    camera.aspect = box.clientWidth / Math.max(1, box.clientHeight);
    camera.updateProjectionMatrix();
    draw();
  }

  let flight = 0;
  // Moves the viewer to `position`, looking at `target`.
  function fly(position, target, isAtOnce, arrived) {
    const from = camera.position.clone(), fromTarget = controls.target.clone();
    const started = performance.now(), number = ++flight;
    const step = (now) => {
      if (number !== flight) return;
      const t = isAtOnce ? 1 : Math.min(1, (now - started) / 700);
      const smooth = t * t * (3 - 2 * t);
      camera.position.lerpVectors(from, position, smooth);
      controls.target.lerpVectors(fromTarget, target, smooth);
      controls.update();
      draw();
      if (t < 1) requestAnimationFrame(step);
      else if (arrived) arrived();
    };
    step(started);
  }

  // The whole from behind the cameras and a little above: where they look on average.
  function home(isAtOnce) {
    const forward = new THREE.Vector3(), middle = new THREE.Vector3();
    view.indices.forEach((i, k) => {
      forward.add(toViewDirection(axisOf(i, 2)));
      middle.add(view.centers[k]);
    });
    if (forward.length() < 0.2 * view.indices.length) forward.copy(middle).negate();
    forward.y = 0;
    if (forward.length() < 1e-3) forward.set(0, 0, -1);
    const back = forward.normalize().negate().add(new THREE.Vector3(0, 0.35, 0)).normalize();
    // As near as most cameras, and a ball of radius 1 around most points, are in the picture.
    const tanUp = 0.9 * Math.tan(camera.fov / 2 * Math.PI / 180), tanRight = tanUp * camera.aspect;
    const right = new THREE.Vector3(0, 1, 0).cross(back).normalize(), up = back.clone().cross(right);
    const distances = view.centers.map((center) => center.dot(back) + 2 * view.frustum +
      Math.max(Math.abs(center.dot(right)) / tanRight, Math.abs(center.dot(up)) / tanUp));
    const distance = Math.max(0.9 / Math.sin(Math.atan(Math.min(tanUp, tanRight))), ...distances.sort((a, b) => a - b).slice(0, Math.ceil(0.95 * distances.length)));
    fly(back.multiplyScalar(distance), new THREE.Vector3(), isAtOnce);
  }

  function flyToImage(i) {
    if (images[i].model < 0) return;
    if (images[i].model !== view.model) showModel(images[i].model);
    const center = toView(centerOf(i)), forward = toViewDirection(axisOf(i, 2));
    const depth = Math.max(0.1, new THREE.Vector3().sub(center).dot(forward));
    fly(center.clone().addScaledVector(forward, -1.5 * view.frustum), center.clone().addScaledVector(forward, depth), false,
      () => { view.flownTo = i; });
  }

  // ---- hovering and clicking

  // The camera nearest to a place of the canvas, within some pixels, or -1.
  function imageAt(x, y) {
    let best = -1, bestDistance = 18 * 18;
    const projected = new THREE.Vector3();
    view.centers.forEach((center, k) => {
      projected.copy(center).project(camera);
      if (projected.z > 1) return;
      const dx = (projected.x + 1) / 2 * canvas.clientWidth - x, dy = (1 - projected.y) / 2 * canvas.clientHeight - y;
      if (dx * dx + dy * dy < bestDistance) [best, bestDistance] = [view.indices[k], dx * dx + dy * dy];
    });
    return best;
  }

  function showTip(i, x, y) {
    const tip = byId("view-tip");
    tip.hidden = i < 0;
    canvas.style.cursor = i < 0 ? "grab" : "pointer";
    if (i < 0) return;
    const url = picture(i);
    tip.replaceChildren(...(url ? [element("img", {src: url, alt: ""})] : []), element("strong", {}, images[i].name),
      element("div", {className: "soft"}, plural(images[i].points, "point") + ", " + short(images[i].error_px) + " px"));
    tip.style.left = Math.max(4, Math.min(x + 14, canvas.clientWidth - 215)) + "px";
    tip.style.top = Math.max(4, Math.min(y + 14, canvas.clientHeight - 190)) + "px";
  }

  let pressed = null;
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons) return showTip(-1);
    const i = imageAt(event.offsetX, event.offsetY);
    showTip(i, event.offsetX, event.offsetY);
  });
  canvas.addEventListener("pointerleave", () => showTip(-1));
  canvas.addEventListener("pointerdown", (event) => {
    pressed = [event.offsetX, event.offsetY];
    ++flight;
  });
  canvas.addEventListener("click", (event) => {
    if (pressed && Math.hypot(event.offsetX - pressed[0], event.offsetY - pressed[1]) > 4) return;
    const i = imageAt(event.offsetX, event.offsetY);
    if (i >= 0) flyToImage(i);
  });

  // ---- controls

  function showModel(k) {
    view.model = k;
    view.indices = images.map((_, i) => i).filter((i) => images[i].model === k);
    view.frame = frameOf(view.indices, block(models[k].xyz, Float32Array));
    view.size = models[k].shown < 20000 ? 3 : models[k].shown < 200000 ? 2 : 1.5;
    view.frustum = 0.05 * Math.max(1, median(view.indices.map((i) => toView(centerOf(i)).length())));
    makePoints(models[k]);
    makeFrusta();
    makeEdges();
    const select = byId("scene-controls").querySelector("select.model");
    if (select) select.value = String(k);
    home(true);
  }

  function range(text, min, max, value, changed) {
    const input = element("input", {type: "range", min, max, step: "any", value});
    input.addEventListener("input", () => {
      changed(Number(input.value));
      draw();
    });
    return element("label", {}, text, input);
  }

  function writeControls() {
    const box = byId("scene-controls");
    if (models.length > 1) {
      const label = chooser("model", models.map((model, k) => [String(k), model.name + " (" + plural(model.images, "photo") + ")"]), (value) => showModel(Number(value)));
      label.querySelector("select").className = "model";
      box.append(label);
    }
    box.append(
      checkbox("points", true, null, (on) => { view.points.visible = on; draw(); }),
      checkbox("cameras", true, "#bf2a1f", (on) => { view.frusta.visible = on; draw(); }),
      range("size of points", 0.5, 8, 3, (value) => { view.points.material.size = view.pointSize = value; }),
      range("size of cameras", 0.1, 4, 1, (value) => { view.scale = value; makeFrusta(); }));
    const total = models.reduce((sum, model) => sum + model.points, 0), inFile = models.reduce((sum, model) => sum + model.shown, 0);
    if (inFile < total) box.append(element("span", {className: "soft"}, whole(inFile) + " of " + whole(total) + " points are in this file"));
    const states = data.pairs.states.filter((state) => STATES[state] && data.pairs.counts[state]);
    const changed = () => { makeEdges(); draw(); };
    byId("edge-controls").append(...stateBoxes(edgeStates.states, states, changed), slider((inliers) => { edgeStates.minInliers = inliers; changed(); }));
    byId("view-home").addEventListener("click", () => home(false));
    document.addEventListener("fly", (event) => {
      if (images[event.detail].model < 0) return;
      byId("scene").scrollIntoView({behavior: "smooth"});
      flyToImage(event.detail);
    });
  }

  controls.addEventListener("change", draw);
  writeControls();
  resize();
  showModel(0);
  addEventListener("resize", resize);
  // For tests: what is in the view.
  window.cairnView = view;
})();
