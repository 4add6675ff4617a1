"""From police-reported fatal crashes to runnable, judged crash scenarios on the real road."""

__version__ = "0.1.0"
