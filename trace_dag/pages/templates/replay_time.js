// The controls and keys of a time line that ends at `end` (s). `draw` shows a moment; the clock is `draw`'s answer. Around
// the `impact` (s, or null) time runs slower if that is chosen.
const SLOW = { before: .4, after: .8, rate: .25 };
// `events` are the reported ones: a mark where each happens, those that do not are struck out at the end.
function timeline(end, draw, impact, events = []) {
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
    show(line.now + (stamp - last) / 1000 * rate());
    last = stamp;
    if (line.now >= end) stop(); else requestAnimationFrame(tick);
  }
  function rate() {
    if ($("rate").value !== "slow") return Number($("rate").value);
    return impact !== null && line.now > impact - SLOW.before && line.now < impact + SLOW.after ? SLOW.rate : 1;
  }
  function toggle() { if (playing) stop(); else play(); }
  function step(by) { stop(); show(line.now + by); }
  $("play").addEventListener("click", toggle);
  $("back").addEventListener("click", () => step(-.02));
  $("forward").addEventListener("click", () => step(.02));
  $("time").max = end;
  const missed = events.filter(each => each.time === null).length;
  const happened = events.filter(each => each.time !== null).sort((one, two) => one.time - two.time);
  let at = 0, before = -4;  // in per cent: marks of one moment stand side by side
  for (const each of [...happened, ...events.filter(each => each.time === null)]) {
    const mark = document.createElement("button");
    Object.assign(mark, { textContent: each.number, title: each.words, className: each.time === null ? "missed" : "" });
    mark.setAttribute("aria-label", each.words);
    mark.style.left = each.time === null ? `calc(100% - ${1.6 * (missed - 1 - at++)}rem)` : `${before = Math.max(100 * each.time / (end || 1), before + 4)}%`;
    if (each.time !== null) mark.addEventListener("click", () => { stop(); show(each.time); });
    $("events").append(mark);
  }
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
