"""A virtual stylus or head, moved from a page in the browser."""

from devices.browser.page_hand import PageHand, PageInput, hand_of

__all__ = ["PageHand", "PageInput", "hand_of"]
