"""Whether texts are cut off or lie on each other."""

from itertools import combinations

from matplotlib.transforms import Bbox

from tests.support.browser import Tab

TOUCHING = 3.0  # [px] of margins that text boxes may share; a letter is 14 px high

# Boxes of the lines of all visible texts outside of scrolling boxes, with their texts.
TEXTS = """() => {
    const found = [], walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    const isLeftOut = "script, style, option, .scroll, .modebar, noscript, details:not([open]) > :not(summary)";
    for (let node = walk.nextNode(); node; node = walk.nextNode()) {
        const parent = node.parentElement, text = node.textContent.trim();
        if (!text || !parent.checkVisibility({ visibilityProperty: true, opacityProperty: true })) continue;
        if (parent.closest(isLeftOut)) continue;
        const range = document.createRange();
        range.selectNodeContents(node);
        for (const { left, top, right, bottom, width } of range.getClientRects()) {
            if (width > 0) found.push([text, left, top + scrollY, right, bottom + scrollY]);
        }
    }
    return found;
}"""


def overlap(one: Bbox, other: Bbox) -> float:
    """The smaller side of what two boxes share [px]."""
    return min(min(one.x1, other.x1) - max(one.x0, other.x0), min(one.y1, other.y1) - max(one.y0, other.y0))


def check_texts(tab: Tab, least: int) -> None:
    """Assert that the visible texts of a page, at least so many, are whole and apart."""
    viewport = tab.page.viewport_size
    assert viewport is not None
    texts = [(text, Bbox.from_extents(*box)) for text, *box in tab.ask(TEXTS)]
    assert len(texts) >= least
    for text, box in texts:
        assert box.x0 > -1, text
        assert box.x1 < viewport["width"] + 1, f"{text!r} leaves the page"
    for (text, box), (other, its) in combinations(texts, 2):
        assert overlap(box, its) < TOUCHING, f"{text!r} lies on {other!r}"
