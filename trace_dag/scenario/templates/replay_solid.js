// The 3D view beside the plan: it shows the same moments, from wherever one likes to look.
const PANES = ["plan", "both", "solid"];
let solid = null, shown = "plan", chosen = false;
function run(code) {
  const script = document.createElement("script");
  script.textContent = code;
  document.head.append(script);
}
// "no", "slow" without a graphics processor, or "fast".
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
function drawing() {
  try {
    const gl = document.createElement("canvas").getContext("webgl2");
    if (!gl) return "no";
    const names = gl.getExtension("WEBGL_debug_renderer_info");
    const slow = SOFTWARE.test(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    return slow ? "slow" : "fast";
  } catch {
    return "no";
  }
}
const able = drawing();
// The glTF. Of its numbers the differences are kept; see trace_dag/scenario/solid/packing.py.
async function model() {
  const kept = new Uint8Array(await held("solid")), lengths = new DataView(kept.buffer), start = 28 + lengths.getUint32(12, true);
  const glb = new Uint8Array(lengths.getUint32(8, true)), numbers = new DataView(glb.buffer, start);
  glb.set(kept.subarray(0, start));
  const { accessors, bufferViews } = JSON.parse(new TextDecoder().decode(kept.subarray(20, start - 8)));
  const planes = [0, 1, 2, 3].map(k => kept.subarray(start + k * (kept.length - start) / 4));
  let next = 0;
  function difference() {
    const from_0_up = planes[0][next] | planes[1][next] << 8 | planes[2][next] << 16 | planes[3][next++] << 24;
    return from_0_up >>> 1 ^ -(from_0_up & 1);
  }
  for (const { bufferView, componentType, count, type } of accessors) {
    const { byteOffset, target } = bufferViews[bufferView], width = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 }[type];
    for (let k = 0; k < width; k++) for (let at = k, number = 0; at < count * width; at += width) {
      number += difference();
      if (componentType === 5126) numbers.setFloat32(byteOffset + 4 * at, number / (target ? 1024 : 4096), true);
      else if (componentType === 5123) numbers.setUint16(byteOffset + 2 * at, number, true);
      else numbers.setUint32(byteOffset + 4 * at, number, true);
    }
  }
  return glb.buffer;
}
// Where a body of the best estimate is: x, y and heading.
function logged(number, now) {
  const [a, b, f] = at(now), v = D.vehicles.find(v => v.number === number);
  return Object.fromEntries(["x", "y", "h"].map(name => [name, v[name][a] + f * (v[name][b] - v[name][a])]));
}
let started = null;
function start() {
  return started ??= (async () => {
    if (typeof replay3d === "undefined") await library();
    const dim = matchMedia("(prefers-color-scheme: dark)").matches;
    const colours = Object.fromEntries(D.vehicles.map(v => [v.number, v.colour]));
    solid = await replay3d.create($("solid"), await model(), { night: D.night, dim, slow: able === "slow", colours, courses, logged });
    look_from();
    solid.show(line.now);
    choose_course();
    requestAnimationFrame(() => { document.body.dataset.solid = "drawn"; performance.mark("drawn in 3D"); });
  })().catch(error => refuse(`The 3D view could not be drawn (${error.message}); the plan view shows the same.`));
}
function refuse(why) {
  $("refused").textContent = why;
  for (const b of document.querySelectorAll("#panes button")) b.disabled = b.dataset.pane !== "plan";
  show_pane("plan");
}
function show_pane(name) {
  shown = name;
  $("stage").dataset.pane = name;
  for (const b of document.querySelectorAll("#panes button")) b.setAttribute("aria-pressed", b.dataset.pane === name);
  if (name !== "plan") start().then(() => solid?.resize());
  frame();
}
// From where: "around" what the plan shows, "behind" a party, or through its "eyes".
function look_from() {
  if (!solid) return;
  const [name, number] = $("camera").value.split(" ");
  if (name !== "around") solid.camera(name === "eyes" ? "eyes" : "follow", { number: Number(number) });
  else if (view === "follow") solid.camera("follow", { number: D.vehicles[0].number });
  else {
    const [w, s, e, n] = view === "overview" ? D.overview : D.impact;
    if (view !== "free") solid.camera("orbit", { place: [(w + e) / 2, (s + n) / 2, e - w] });
  }
}
for (const v of D.vehicles.filter(v => !is_trailer(v))) for (const [name, words] of [["behind", `Behind ${v.name}`], ["eyes", `Eyes of ${v.name}`]])
  $("camera").add(new Option(words, `${name} ${v.number}`));
$("camera").addEventListener("change", () => { chosen = true; look_from(); frame(); });
for (const b of document.querySelectorAll("#panes button")) b.addEventListener("click", () => { chosen = true; show_pane(b.dataset.pane); });
$("save").addEventListener("click", async () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([await model()], { type: "model/gltf-binary" }));
  link.download = `${D.key}.glb`;
  link.click();
});
