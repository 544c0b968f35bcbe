"""A virtual stylus or head, moved from a page in the browser."""

from devices.browser.page_hand import Obedience, PageHand, PageInput, hand_of

__all__ = ["Obedience", "PageHand", "PageInput", "hand_of"]
