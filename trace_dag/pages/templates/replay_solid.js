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
const model = () => held("solid"); // the glTF
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
    solid = await replay3d.create($("solid"), await model(), { night: D.night, dim, slow: able === "slow", colours, courses, logged, moment: D.moment });
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
  line.show(line.now);
}
// From where: beside ("around") what the plan shows, "behind" a party, or through its "eyes".
function look_from() {
  if (!solid) return;
  const [name, number] = $("camera").value.split(" ");
  if (name !== "around") solid.camera(name, { number: Number(number) });
  else if (view !== "free") solid.camera(view, { place: D.overview });
}
for (const v of D.vehicles.filter(v => !is_trailer(v))) for (const [name, words] of [["behind", `behind ${v.name}`], ["eyes", `eyes of ${v.name}`]])
  $("camera").add(new Option(words, `${name} ${v.number}`));
$("camera").addEventListener("change", () => { chosen = true; look_from(); frame(); });
for (const b of document.querySelectorAll("#panes button")) b.addEventListener("click", () => { chosen = true; show_pane(b.dataset.pane); });
$("save").addEventListener("click", async () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([await model()], { type: "model/gltf-binary" }));
  link.download = `${D.key}.glb`;
  link.click();
});
