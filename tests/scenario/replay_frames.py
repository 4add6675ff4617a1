"""Measures what a replay shows, in a real browser: who is in the picture, how much of whom is seen, what covers it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from browser import Page

MOMENTS = {
    "first": "0",
    "contact": "line.show((D.moment?.time ?? end / 2) + 0.04)",
    "end": "set_view('impact'); line.show(end)",
}
"""What is done to see each of the three frames; the first is what stands there when the page is opened."""

# A body is painted in a colour that nothing else has, first as it stands in the scene, then in front of everything.
_IN_3D = """(() => {
  const gl = solid.renderer.getContext(), { width, height } = solid.canvas, found = [];
  function painted() {
    solid.renderer.render(solid.scene, solid.lens);
    const pixels = new Uint8Array(4 * width * height), at = { count: 0, low: [width, height], high: [0, 0] };
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    for (let k = 0; k < width * height; k++) {
      if (pixels[4 * k] < 240 || pixels[4 * k + 1] > 110 || pixels[4 * k + 2] < 240) continue;
      at.count++;
      for (const [axis, value] of [k % width, Math.floor(k / width)].entries()) {
        at.low[axis] = Math.min(at.low[axis], value);
        at.high[axis] = Math.max(at.high[axis], value);
      }
    }
    return at;
  }
  solid.render();
  for (const [number, node] of solid.nodes) {
    const meshes = [];
    node.traverse((each) => { if (each.isMesh) meshes.push([each, each.material, each.renderOrder]); });
    const paint = meshes[0][1].clone();
    Object.assign(paint, { toneMapped: false, fog: false, roughness: 1, metalness: 0, transparent: false, opacity: 1 });
    paint.color.set(0);
    paint.emissive.setRGB(1, 0, 1);
    for (const [mesh] of meshes) mesh.material = paint;
    const seen = painted();
    paint.depthTest = false;
    paint.transparent = true;
    for (const [mesh] of meshes) mesh.renderOrder = 99;
    const all = painted();
    for (const [mesh, material, order] of meshes) Object.assign(mesh, { material, renderOrder: order });
    const ratio = solid.canvas.clientWidth / width, { left, top } = solid.canvas.getBoundingClientRect();
    const [x, y] = [0, 1].map((axis) => (all.low[axis] + all.high[axis]) / 2);
    found.push({ number, pixels: all.count, seen: seen.count / (all.count || 1),
      covered: document.elementFromPoint(left + ratio * x, top + ratio * (height - y)) !== solid.canvas,
      inside: all.count > 0 && Math.min(...all.low) > 0 && all.high[0] < width - 1 && all.high[1] < height - 1 });
  }
  solid.render();
  return found;
})()"""
_IN_PLAN = """cars.map(({ v }) => {
  const [a, , f] = at(line.now), mix = (row) => row[a] + f * (row[Math.min(a + 1, row.length - 1)] - row[a]);
  const to = $("scene").getScreenCTM(), pane = $("plan").getBoundingClientRect();
  const { x, y } = new DOMPoint(mix(v.x), -mix(v.y)).matrixTransform(to), reach = v.length / 2 * to.a;
  const inside = x - reach >= pane.left && x + reach <= pane.right && y - reach >= pane.top && y + reach <= pane.bottom;
  return { number: v.number, pixels: Math.round(v.length * to.a * Math.max(v.width, 0.4) * to.a), seen: 1, inside,
    covered: inside && !document.elementFromPoint(x, y)?.closest("#scene") };
})"""


@dataclass(frozen=True)
class SeenParty:
    """One party in one frame: how many pixels it has, which share of them is seen, and whether the page covers it."""

    key: str
    moment: str
    view: str
    number: int
    pixels: int
    seen: float
    inside: bool
    covered: bool

    def __str__(self) -> str:
        where = "inside" if self.inside else "CUT OFF"
        return (
            f"{self.key} {self.moment} {self.view} {self.number}: {self.pixels} pixels, {self.seen:.0%} seen, {where}"
            + (", COVERED" if self.covered else "")
        )


def seen_parties(page: Page, address: str, key: str, *, in_3d: bool = True) -> list[SeenParty]:
    """Opens a replay and measures its first frame, the contact and the end, in the plan and in three dimensions."""
    pane = "both" if in_3d else "plan"
    page.open("about:blank")
    page.send("Page.navigate", url=f"{address}#pane={pane}")
    page.wait("document.readyState === 'complete' && document.getElementById('clock')?.textContent")
    if in_3d:
        page.wait("document.body.dataset.solid === 'drawn'")
    found = []
    for moment, script in MOMENTS.items():
        page.run(script)
        rows = [("plan", row) for row in page.run(_IN_PLAN)]
        rows += [("3D", row) for row in page.run(_IN_3D)] if in_3d else []
        found += [_party(key, moment, view, row) for view, row in rows]
    return found


def _party(key: str, moment: str, view: str, row: dict[str, Any]) -> SeenParty:
    return SeenParty(key, moment, view, row["number"], row["pixels"], row["seen"], row["inside"], row["covered"])
