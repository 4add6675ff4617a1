// The 3D view of a replay. The page has the clock: it says what time it is, and this shows the crash as it is then.
// Everything that is seen comes from the page's glTF; nothing is fetched.
import {
  ACESFilmicToneMapping, AnimationMixer, Box3, CanvasTexture, CircleGeometry, Color, DirectionalLight, Fog, HemisphereLight, Matrix4,
  Mesh, MeshLambertMaterial, PCFShadowMap, PerspectiveCamera, Quaternion, Scene, SpotLight, Sprite, SpriteMaterial, SRGBColorSpace,
  Vector3, WebGLRenderer,
} from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { otherCourses } from "./courses.mjs";
import { cutaway } from "./cutaway.mjs";
import { sideOf, standing } from "./framing.mjs";

const SKY = { day: "#b9cfe2", dim: "#75889b", night: "#0e1524" };
const GROUND = "#8fa36b"; // the grass of the glTF
const EYES = new Quaternion().setFromRotationMatrix(new Matrix4().makeBasis(
  new Vector3(0, -1, 0), new Vector3(0, 0, 1), new Vector3(-1, 0, 0))); // a camera's axes in those of a body: x ahead, z up
const FAR_M = 900, SHADOW_M = 45;
const LIT_VEHICLES = 3; // each pair of headlamps costs a light
const FLASH_S = 0.25; // a contact is marked for so long
const CLOSE_M = 5, CLOSE_ON_A_PERSON_M = 2.5; // of the place of a contact

// `box` is the element to draw in, `glb` an ArrayBuffer; `night` says whether it was dark, `dim` whether the page is,
// `slow` that there is no graphics processor: then there are no shadows, and edges are not smoothed. `courses` and `logged`
// are those of courses.mjs, `moment` is when and where it happens and to whom: { time, x, y, numbers }, or null.
export async function create(box, glb, { night = false, dim = false, slow = false, colours = {}, courses = [], logged, moment = null } = {}) {
  const renderer = new WebGLRenderer({ antialias: !slow, powerPreference: "high-performance" });
  renderer.toneMapping = ACESFilmicToneMapping;
  renderer.toneMappingExposure = night ? 1.0 : 0.9;
  renderer.shadowMap.enabled = !slow;
  renderer.shadowMap.type = PCFShadowMap;
  const canvas = renderer.domElement;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", "The crash in three dimensions. A and D turn, W and S tilt, plus and minus zoom.");
  const { scene: world, animations } = await new GLTFLoader().parseAsync(glb, "");
  box.append(canvas);

  const scene = new Scene(), camera = new PerspectiveCamera(50, 1, 0.25, FAR_M);
  scene.add(world);
  const sky = new Color(night ? SKY.night : dim ? SKY.dim : SKY.day);
  scene.background = sky;
  scene.fog = new Fog(sky, 120, night ? 420 : 480);
  scene.add(new HemisphereLight(night ? "#a9b6d2" : "#eaf2fb", night ? "#4a4c48" : "#8b8f78", night ? 4.2 : 1.8));
  const sun = new DirectionalLight(night ? "#b8c2d8" : "#fff3dd", night ? 0.9 : 2.6);
  sun.castShadow = !night;
  sun.shadow.mapSize.set(2048, 2048);
  Object.assign(sun.shadow.camera, { left: -SHADOW_M, right: SHADOW_M, top: SHADOW_M, bottom: -SHADOW_M, near: 10, far: 220 });
  sun.shadow.normalBias = 0.04;
  sun.shadow.bias = -0.0004;
  scene.add(sun, sun.target);

  const bodies = new Map(), contacts = [];
  world.updateMatrixWorld(true);
  world.traverse((each) => {
    const said = each.userData.trace_dag;
    if (said?.kind === "body" || said?.kind === "person") bodies.set(said.number, { node: each, ...said });
    if (said?.kind === "contact") contacts.push({ node: each, ...said });
    if (each.isMesh) {
      const { layer } = each.material.userData;
      if (layer) Object.assign(each.material, { polygonOffset: true, polygonOffsetFactor: -layer, polygonOffsetUnits: -4 * layer });
      each.castShadow = !layer && each.material.opacity === 1;
      each.receiveShadow = true;
      each.frustumCulled = !each.morphTargetInfluences;
    }
  });
  for (const { node } of contacts) node.traverse((each) => {
    if (each.isMesh) { each.material = each.material.clone(); each.material.depthTest = false; each.renderOrder = 9; each.castShadow = false; }
  });
  const lowest = lowestOf(world);
  const plain = new Mesh(new CircleGeometry(FAR_M, 48), new MeshLambertMaterial({ color: GROUND }));
  plain.rotation.x = -Math.PI / 2;
  plain.position.y = lowest - 0.4;
  scene.add(plain);

  const mixer = new AnimationMixer(world), clip = animations[0];
  const action = clip ? mixer.clipAction(clip).play() : null;

  function pose(t) {
    if (action) { action.time = Math.max(0, Math.min(t, clip.duration - 1e-4)); mixer.update(0); }
  }

  for (const body of bodies.values()) {
    body.middle = body.kind === "person" ? body.node.children[0] : body.node;
    body.tag = tag(body.label, colours[body.number] || "#333");
    scene.add(body.tag);
    const { x, y, z } = new Box3().setFromObject(body.node).getSize(new Vector3());
    body.radius = Math.max(Math.hypot(x, z), y) / 2;
    body.front = frontOf(body.node.children[0]);
  }
  let others = null, time = 0;
  const shownOf = (body) => others?.shownOf(body) ?? body.node;
  const middle = (body) => body.kind === "person" ? shownOf(body).children[0] : shownOf(body);
  const at = (body) => middle(body).getWorldPosition(new Vector3());
  const keepInSight = cutaway(world.getObjectByName("place"));
  const spot = placeOfMoment(), side = spot ? sideOf(spot.two, world, 30) : new Vector3(-0.35, 0.62, 0.75).normalize();
  others = otherCourses(world, bodies, contacts, courses, logged, pose);
  if (night) [...bodies.values()].filter((body) => body.kind === "body").slice(0, LIT_VEHICLES).forEach((body) => {
    const lamp = new SpotLight("#fff1d6", 260, 60, 0.42, 0.7, 1.6);
    lamp.position.set(body.front, 0, -0.1);
    lamp.target.position.set(body.front + 20, 0, -1.4);
    lamp.castShadow = !slow;
    body.lamps = [lamp, lamp.target];
    body.node.add(...body.lamps);
  });

  const controls = new OrbitControls(camera, canvas);
  controls.maxPolarAngle = Math.PI / 2 - 0.03;
  controls.minDistance = 2;
  controls.maxDistance = 260;
  controls.enableDamping = false;
  controls.addEventListener("change", () => draw());
  controls.addEventListener("start", () => { held = true; });

  let mode = { name: "follow" }, held = false, followed = null, look = { yaw: 0, pitch: 0 }, asked = 0;
  const place = new Vector3(), turn = new Quaternion(), before = new Vector3();

  function aim() {
    if (mode.name === "eyes") {
      const body = bodies.get(mode.number), node = shownOf(body);
      if (body.kind === "person") node.children[1].getWorldPosition(place);
      else node.localToWorld(place.fromArray(body.eye));
      middle(body).getWorldQuaternion(turn);
      camera.position.copy(place);
      camera.quaternion.copy(turn).multiply(EYES)
        .multiply(new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), look.yaw))
        .multiply(new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), look.pitch));
    } else {
      const { middle: now, eye } = followed ? { middle: at(followed) } : standing(filmed(), side, camera);
      if (eye && !held) {
        controls.target.copy(now);
        camera.position.copy(eye);
      } else {
        const by = now.clone().sub(before);
        controls.target.add(by);
        camera.position.add(by);
      }
      before.copy(now);
      camera.lookAt(controls.target);
    }
    const seen = mode.name === "eyes" ? camera.position : controls.target;
    sun.target.position.copy(seen);
    sun.position.copy(seen).add(new Vector3(38, 80, 30));
  }
  const ballOf = (body) => ({ at: at(body), radius: body.radius });
  // What is to be in the picture: all parties and, until then, where it will happen; or that place and whoever has touched.
  function filmed() {
    if (mode.name === "overview") return corners(mode.place).map((at) => ({ at, radius: 1 }));
    const place = spot ? [{ at: spot.at, radius: spot.close }] : [];
    if (mode.name === "follow" || !spot) return [...bodies.values()].map(ballOf).concat(time < (moment?.time ?? 0) ? place : []);
    const touched = [moment, ...contacts.map(({ time_s, numbers }) => ({ time: time_s, numbers }))].filter((each) => each.time <= time);
    const numbers = new Set(touched.flatMap((each) => each.numbers));
    return place.concat([...bodies.values()].filter((body) => numbers.has(body.number)).map(ballOf));
  }
  function corners([west, south, east, north]) {
    const y = heightNear((west + east) / 2, (south + north) / 2);
    return [[west, south], [west, north], [east, south], [east, north]].map(([x, n]) => new Vector3(x, y, -n));
  }
  // Where it happens, and the two that have to be seen beside each other there: two parties, or one and what it strikes.
  function placeOfMoment() {
    if (!moment) return null;
    pose(moment.time);
    world.updateMatrixWorld(true);
    const [one, other] = moment.numbers.map((number) => bodies.get(number)).filter(Boolean);
    if (!one) return null;
    const where = at(one), there = new Vector3(moment.x, where.y, -moment.y);
    const ahead = () => new Vector3(5, 0, 0).applyQuaternion(one.middle.getWorldQuaternion(new Quaternion()));
    const two = [where, other ? at(other) : there.distanceTo(where) > 0.5 ? there : where.clone().add(ahead())];
    return { two, at: there, close: one.kind === "person" || other?.kind === "person" ? CLOSE_ON_A_PERSON_M : CLOSE_M };
  }
  function render() {
    asked = 0;
    others.see(mode.name === "eyes" ? mode.number : null);
    aim();
    const seen = [...bodies.values()].map((body) => ({ at: at(body), radius: Math.max(1.5, 1.4 * body.radius) }));
    keepInSight(seen, mode.name !== "eyes");
    for (const body of bodies.values()) {
      body.tag.position.copy(at(body));
      body.tag.position.y += body.kind === "person" ? 1.9 : 2.6;
      body.tag.visible = !(mode.name === "eyes" && mode.number === body.number);
    }
    for (const contact of [...contacts, ...others.marks]) {
      const size = Math.max(1, camera.position.distanceTo(contact.node.getWorldPosition(place)) / 16);
      const flashes = time >= contact.time_s && time < contact.time_s + FLASH_S && others.isShown(contact);
      contact.node.scale.setScalar(flashes ? size : 0);
    }
    renderer.render(scene, camera);
  }
  function draw() { if (!asked) asked = requestAnimationFrame(render); }

  function show(t) {
    time = t;
    pose(t);
    others.show(t);
    for (const body of bodies.values()) if (body.lamps) shownOf(body).add(...body.lamps);
    world.updateMatrixWorld(true);
    draw();
  }
  // Which course is shown in full, null for the best estimate; the others are `faint` or not seen.
  function choose(course, faint) {
    others.choose(course, faint);
    show(time);
  }
  // What to look at: all parties ("follow"), the "impact", a "place" [west, south, east, north] ("overview"); or from where:
  // "behind" a party by number, or through its "eyes".
  function camera_to(name, { number, place: where } = {}) {
    mode = { name, number, place: where };
    held = false;
    followed = name === "behind" ? bodies.get(number) : null;
    look = { yaw: 0, pitch: 0 };
    controls.enabled = name !== "eyes";
    camera.fov = name === "eyes" ? 62 : 50;
    camera.updateProjectionMatrix();
    if (followed) {
      before.copy(at(followed));
      middle(followed).getWorldQuaternion(turn);
      const ahead = new Vector3(1, 0, 0).applyQuaternion(turn).setY(0);
      if (ahead.lengthSq() < 0.01) ahead.set(1, 0, 0);
      ahead.normalize();
      const back = followed.kind === "person" ? 7 : 13;
      controls.target.copy(before);
      camera.position.copy(before).addScaledVector(ahead, -back).add(new Vector3(0, back * 0.42, 0));
    }
    draw();
  }
  function heightNear(x, y) { // of the body nearest to a place: what is looked at is near one
    let nearest = null, least = Infinity;
    for (const body of bodies.values()) {
      const there = at(body), away = Math.hypot(there.x - x, -there.z - y);
      if (away < least) { least = away; nearest = there.y; }
    }
    return nearest ?? 0;
  }

  let width = 0, height = 0;
  function resize() {
    const r = box.getBoundingClientRect();
    if (!r.width || !r.height || (r.width === width && r.height === height)) return;
    [width, height] = [r.width, r.height];
    renderer.setPixelRatio(Math.min(devicePixelRatio, slow ? 1 : 2));
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    draw();
  }
  new ResizeObserver(resize).observe(box);
  resize();

  function turn_by(yaw, pitch) {
    if (mode.name === "eyes") {
      look.yaw += yaw;
      look.pitch = Math.max(-1.2, Math.min(1.2, look.pitch + pitch));
    } else {
      const offset = camera.position.clone().sub(controls.target), length = offset.length();
      const around = Math.atan2(offset.x, offset.z) + yaw;
      const down = Math.max(0.05, Math.min(controls.maxPolarAngle, Math.acos(offset.y / length) + pitch));
      held = true;
      camera.position.copy(controls.target).add(new Vector3().setFromSphericalCoords(length, down, around));
      camera.lookAt(controls.target);
    }
    draw();
  }
  function zoom(by) {
    const offset = camera.position.clone().sub(controls.target);
    const length = Math.max(controls.minDistance, Math.min(controls.maxDistance, offset.length() * by));
    held = true;
    if (mode.name !== "eyes") camera.position.copy(controls.target).add(offset.setLength(length));
    draw();
  }
  canvas.addEventListener("keydown", (event) => {
    const act = { a: () => turn_by(-0.08, 0), d: () => turn_by(0.08, 0), w: () => turn_by(0, -0.06), s: () => turn_by(0, 0.06),
      "+": () => zoom(0.85), "=": () => zoom(0.85), "-": () => zoom(1 / 0.85) }[event.key.toLowerCase()];
    if (act && !event.ctrlKey && !event.metaKey) { event.preventDefault(); act(); }
  });
  let grip = null; // who looks through somebody's eyes turns the head
  canvas.addEventListener("pointerdown", (event) => { if (mode.name === "eyes") { grip = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); } });
  canvas.addEventListener("pointermove", (event) => {
    if (!grip) return;
    turn_by((event.clientX - grip[0]) * 0.004, (event.clientY - grip[1]) * 0.004);
    grip = [event.clientX, event.clientY];
  });
  for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { grip = null; });
  // Where a party is and where one looks from, in the crash's frame: east, north, up.
  const local = ({ x, y, z }) => [x, -z, y];
  return { show, choose, camera: camera_to, resize, canvas, numbers: [...bodies.keys()], renderer, scene, lens: camera, render,
    nodes: new Map([...bodies].map(([number, body]) => [number, body.node])),
    place: (number) => local(at(bodies.get(number))), eye: () => local(camera.position) };
}

// How far ahead of its middle a body reaches, m.
function frontOf(shell) {
  let ahead = 0;
  shell.traverse((each) => {
    if (!each.isMesh) return;
    each.geometry.computeBoundingBox();
    ahead = Math.max(ahead, each.geometry.boundingBox.max.x);
  });
  return ahead;
}

function lowestOf(world) {
  let lowest = Infinity;
  const corner = new Vector3();
  world.traverse((each) => {
    if (!each.isMesh || each.parent?.name !== "roads_and_ground") return;
    each.geometry.computeBoundingBox();
    for (const z of [each.geometry.boundingBox.min, each.geometry.boundingBox.max])
      lowest = Math.min(lowest, corner.copy(z).applyMatrix4(each.matrixWorld).y);
  });
  return Number.isFinite(lowest) ? lowest : 0;
}

// A small board with a party's name that floats above it, of one size on the screen.
function tag(text, colour) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [96, 48];
  const pen = canvas.getContext("2d");
  pen.fillStyle = colour;
  pen.beginPath();
  pen.roundRect(2, 2, 92, 44, 12);
  pen.fill();
  pen.strokeStyle = "#fff";
  pen.lineWidth = 3;
  pen.stroke();
  const [r, g, b] = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  pen.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 160 ? "#111" : "#fff";
  pen.font = "700 30px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(text, 48, 26);
  const map = new CanvasTexture(canvas);
  map.colorSpace = SRGBColorSpace;
  const sprite = new Sprite(new SpriteMaterial({ map, sizeAttenuation: false, depthTest: false, fog: false, toneMapped: false }));
  sprite.scale.set(0.052, 0.026, 1);
  sprite.center.set(0.5, 0);
  sprite.renderOrder = 10;
  return sprite;
}
