"""What a person reaches and sees of a page: the order of the Tab key, and texts that are cut off."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Page

# Everything in sight that can have the focus, in the dialog that is open or else on the page.
_FOCUSABLE = """[...(document.querySelector('.q-dialog') ?? document)
    .querySelectorAll('button, a[href], input, select, summary, canvas, textarea, [tabindex="0"]')]
    .filter(one => one.checkVisibility() && !one.disabled && one.type !== 'hidden')"""
_BEGIN_WALK = f"""() => {{
    document.activeElement?.blur();
    window.walked = new Set();
    window.addEventListener('focusin', (event) => window.walked.add(event.target));
    return {_FOCUSABLE}.length;
}}"""
_NOT_WALKED = f"{_FOCUSABLE}.filter(one => !window.walked.has(one)).map(one => one.outerHTML.slice(0, 160))"


def out_of_reach_by_tab(page: Page) -> list[str]:
    """What the Tab key never comes to, on the page or in the dialog that is open.

    A dialog holds the focus from the end of its opening transition on, 0.3 s: it gets a second walk.
    """
    missed = _walk(page)
    if missed:
        page.wait_for_timeout(500)
        missed = _walk(page)
    return missed


def _walk(page: Page) -> list[str]:
    count = int(page.evaluate(_BEGIN_WALK))
    assert count > 0
    for _ in range(count + 20):
        page.keyboard.press("Tab")
    return list(page.evaluate(_NOT_WALKED))


# Texts that their own box cuts off, or that end beyond the page; what scrolls sideways may.
_CUT_TEXTS = """() => {
    const pen = document.createElement('canvas').getContext('2d');
    const seen = { opacityProperty: true, visibilityProperty: true };
    const scrolls = '.scroll-x, nav, .listing, .q-notification', arrow = 34;
    const isCut = (one) => {
        if (one.tagName === 'OPTION' || !one.checkVisibility(seen)) return false;
        const style = getComputedStyle(one), box = one.getBoundingClientRect();
        if (!text(one) || !box.width) return false;
        if (box.right > innerWidth + 1 && !one.closest(scrolls)) return true;
        if (one.tagName === 'SELECT') {
            pen.font = style.font; // a telephone shows as much of the choice as there is room for
            return innerWidth > 820 && pen.measureText(text(one)).width > one.clientWidth - arrow;
        }
        const hides = !['visible', 'auto', 'scroll'].includes(style.overflowX);
        return hides && one.scrollWidth > one.clientWidth + 1;
    };
    const text = (one) => one.tagName === 'SELECT' ? one.selectedOptions[0]?.text ?? ''
        : [...one.childNodes].filter(node => node.nodeType === 3).map(node => node.data.trim()).join('');
    const all = document.querySelectorAll('header *, main *, .fault-banner *, .q-dialog *');
    return [...all].filter(isCut).map(one => `${one.tagName}: ${text(one)}`);
}"""


def cut_texts(page: Page) -> list[str]:
    """Texts that are not all in sight, for no reason."""
    return list(page.evaluate(_CUT_TEXTS))
