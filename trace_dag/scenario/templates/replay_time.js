// The controls and keys of a time line that ends at `end` (s). `draw` shows a moment; the clock is `draw`'s answer.
function timeline(end, draw) {
  const line = { now: 0, show, stop };
  let playing = false, last = 0;
  function show(t) {
    line.now = Math.min(end, Math.max(0, t));
    $("time").value = line.now;
    $("clock").textContent = line.now.toFixed(2) + " s" + draw(line.now);
  }
  function stop() { playing = false; $("play").textContent = "Play"; }
  function play() { if (line.now >= end) line.now = 0; playing = true; $("play").textContent = "Pause"; last = performance.now(); requestAnimationFrame(tick); }
  function tick(stamp) {
    if (!playing) return;
    show(line.now + (stamp - last) / 1000 * Number($("rate").value));
    last = stamp;
    if (line.now >= end) stop(); else requestAnimationFrame(tick);
  }
  function toggle() { if (playing) stop(); else play(); }
  function step(by) { stop(); show(line.now + by); }
  $("play").addEventListener("click", toggle);
  $("back").addEventListener("click", () => step(-.02));
  $("forward").addEventListener("click", () => step(.02));
  $("time").max = end;
  $("time").addEventListener("input", () => { stop(); show(Number($("time").value)); });
  document.addEventListener("keydown", e => {
    if (e.defaultPrevented || e.target.tagName === "SELECT") return;
    if (e.key === " " && !["INPUT", "BUTTON"].includes(e.target.tagName)) { e.preventDefault(); toggle(); }
    if (e.key === "ArrowLeft") { e.preventDefault(); step(e.shiftKey ? -.5 : -.02); }
    if (e.key === "ArrowRight") { e.preventDefault(); step(e.shiftKey ? .5 : .02); }
    if (e.key === "Home") step(-end);
  });
  return line;
}
