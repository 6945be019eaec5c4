"""Counters of the service in the text format of Prometheus."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

Labels = tuple[tuple[str, str], ...]
BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)


@dataclass(frozen=True, slots=True)
class Metric:
    """One metric with its samples; `kind` is counter, gauge or histogram."""

    name: str
    kind: str
    text: str
    samples: Mapping[tuple[str, Labels], float]


@dataclass(slots=True)
class Counters:
    """What was counted since the start; safe to use from any thread."""

    _values: dict[str, dict[tuple[str, Labels], float]] = field(default_factory=lambda: defaultdict(dict))
    _about: dict[str, tuple[str, str]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, name: str, text: str, amount: float = 1.0, **labels: str) -> None:
        """Add to a counter."""
        key = ("", tuple(sorted(labels.items())))
        with self._lock:
            self._about[name] = ("counter", text)
            self._values[name][key] = self._values[name].get(key, 0.0) + amount

    def observe(self, name: str, text: str, value: float, **labels: str) -> None:
        """Add a value to a histogram."""
        pairs = tuple(sorted(labels.items()))
        with self._lock:
            self._about[name] = ("histogram", text)
            samples = self._values[name]
            for bound in (*BUCKETS, float("inf")):
                key = ("_bucket", (*pairs, ("le", "+Inf" if bound == float("inf") else f"{bound:g}")))
                samples[key] = samples.get(key, 0.0) + (value <= bound)
            for suffix, amount in (("_sum", value), ("_count", 1.0)):
                samples[suffix, pairs] = samples.get((suffix, pairs), 0.0) + amount

    def highest(self, name: str, text: str, value: float, **labels: str) -> None:
        """Keep the largest value in a gauge."""
        key = ("", tuple(sorted(labels.items())))
        with self._lock:
            self._about[name] = ("gauge", text)
            self._values[name][key] = max(value, self._values[name].get(key, 0.0))

    def metrics(self) -> list[Metric]:
        """All of them, copied."""
        with self._lock:
            return [Metric(name, *self._about[name], dict(samples)) for name, samples in self._values.items()]


def gauge(name: str, text: str, found: Mapping[Labels, float] | float) -> Metric:
    """A metric that is read when it is asked for, with labels or without."""
    values = found if isinstance(found, Mapping) else {(): float(found)}
    return Metric(name, "gauge", text, {("", labels): value for labels, value in values.items()})


def written(metrics: Iterable[Metric]) -> str:
    """The text format, version 0.0.4."""
    lines = []
    for metric in sorted(metrics, key=lambda m: m.name):
        lines += [f"# HELP {metric.name} {metric.text}", f"# TYPE {metric.name} {metric.kind}"]
        for (suffix, pairs), value in metric.samples.items():
            lines.append(f"{metric.name}{suffix}{_labels(pairs)} {value:.10g}")
    return "\n".join(lines) + "\n"


def _labels(pairs: Labels) -> str:
    if not pairs:
        return ""
    escaped = (value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") for _, value in pairs)
    return "{" + ",".join(f'{name}="{value}"' for (name, _), value in zip(pairs, escaped, strict=True)) + "}"
