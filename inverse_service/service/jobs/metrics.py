"""What the service counts, in the text format of Prometheus."""

import threading
from collections.abc import Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import prometheus_client
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric

BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)
prometheus_client.disable_created_metrics()  # type: ignore[no-untyped-call]


class Counters:
    """What was counted since the start; safe to use from any thread."""

    def __init__(self) -> None:
        self._registry = prometheus_client.CollectorRegistry()
        self._known: dict[str, Any] = {}
        self._highest: dict[tuple[str, ...], float] = {}
        self._lock = threading.Lock()

    def add(self, name: str, text: str, amount: float = 1.0, **labels: str) -> None:
        """Add to a counter."""
        self._metric(prometheus_client.Counter, name, text, labels).inc(amount)

    def observe(self, name: str, text: str, value: float, **labels: str) -> None:
        """Add a value to a histogram."""
        self._metric(prometheus_client.Histogram, name, text, labels).observe(value)

    def highest(self, name: str, text: str, value: float, **labels: str) -> None:
        """Keep the largest value in a gauge."""
        gauge, key = self._metric(prometheus_client.Gauge, name, text, labels), (name, *labels.values())
        with self._lock:
            self._highest[key] = max(value, self._highest.get(key, value))
            gauge.set(self._highest[key])

    def written(self, families: Iterable[Metric]) -> bytes:
        """All of it with these, which are read when they are asked for."""
        read: Any = SimpleNamespace(collect=lambda: [*self._registry.collect(), *families])
        return prometheus_client.generate_latest(read)

    def _metric(self, kind: Any, name: str, text: str, labels: Mapping[str, str]) -> Any:
        found = self._known.get(name)
        if found is None:
            with self._lock:
                found = self._known.get(name)
                if found is None:
                    more = {"buckets": BUCKETS} if kind is prometheus_client.Histogram else {}
                    found = self._known[name] = kind(name, text, tuple(labels), registry=self._registry, **more)
        return found.labels(*labels.values()) if labels else found


def gauge(name: str, text: str, found: Mapping[tuple[str, ...], float] | float, labels: tuple[str, ...] = ()) -> Metric:
    """A metric that is read when it is asked for, with labels or without."""
    family = GaugeMetricFamily(name, text, labels=labels)
    for values, value in found.items() if isinstance(found, Mapping) else [((), float(found))]:
        family.add_metric(values, value)
    return family
