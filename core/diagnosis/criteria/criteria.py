"""Every threshold of the diagnosis, its version, and a table of it for people."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, fields

from palpate.diagnosis.criteria.forward_criteria import (
    DerivativeCriteria,
    HistoryCriteria,
    RayComparisonCriteria,
    ReplayCriteria,
)
from palpate.diagnosis.criteria.inference_criteria import (
    FitCriteria,
    IntervalCriteria,
    NoiseCriteria,
    PriorCriteria,
    RestCriteria,
    StructureCriteria,
)
from palpate.diagnosis.criteria.observation_criteria import (
    CameraErrorCriteria,
    ForceErrorCriteria,
    ForceOnlyCriteria,
    GroupingCriteria,
    OutlierCriteria,
)
from palpate.diagnosis.criteria.report_criteria import (
    ClueCriteria,
    DesignCriteria,
    FigureCriteria,
    FootprintCriteria,
    StiffnessMapCriteria,
    VerdictCriteria,
)
from palpate.diagnosis.criteria.search_criteria import (
    InclusionGridCriteria,
    NamingCriteria,
    ScreeningCriteria,
    TouchPairingCriteria,
)
from palpate.diagnosis.criteria.validation_criteria import (
    ControlCriteria,
    GainCriteria,
    RejectionCriteria,
    StiffnessErrorCriteria,
)

__all__ = ["CRITERIA", "Criteria", "CriterionRow", "criteria_rows"]

_REVISION = 1
"""Number before the digest in `Criteria.version`; raised when a threshold changes its meaning."""


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """Every threshold of the diagnosis, by topic."""

    grouping: GroupingCriteria = field(default_factory=GroupingCriteria)
    force_only: ForceOnlyCriteria = field(default_factory=ForceOnlyCriteria)
    force_error: ForceErrorCriteria = field(default_factory=ForceErrorCriteria)
    outliers: OutlierCriteria = field(default_factory=OutlierCriteria)
    replay: ReplayCriteria = field(default_factory=ReplayCriteria)
    rays: RayComparisonCriteria = field(default_factory=RayComparisonCriteria)
    derivatives: DerivativeCriteria = field(default_factory=DerivativeCriteria)
    history: HistoryCriteria = field(default_factory=HistoryCriteria)
    priors: PriorCriteria = field(default_factory=PriorCriteria)
    noise: NoiseCriteria = field(default_factory=NoiseCriteria)
    camera_error: CameraErrorCriteria = field(default_factory=CameraErrorCriteria)
    rest: RestCriteria = field(default_factory=RestCriteria)
    fits: FitCriteria = field(default_factory=FitCriteria)
    structure: StructureCriteria = field(default_factory=StructureCriteria)
    intervals: IntervalCriteria = field(default_factory=IntervalCriteria)
    naming: NamingCriteria = field(default_factory=NamingCriteria)
    screening: ScreeningCriteria = field(default_factory=ScreeningCriteria)
    inclusion_grid: InclusionGridCriteria = field(default_factory=InclusionGridCriteria)
    touch_pairing: TouchPairingCriteria = field(default_factory=TouchPairingCriteria)
    gain: GainCriteria = field(default_factory=GainCriteria)
    rejection: RejectionCriteria = field(default_factory=RejectionCriteria)
    stiffness_error: StiffnessErrorCriteria = field(default_factory=StiffnessErrorCriteria)
    controls: ControlCriteria = field(default_factory=ControlCriteria)
    verdict: VerdictCriteria = field(default_factory=VerdictCriteria)
    figures: FigureCriteria = field(default_factory=FigureCriteria)
    clues: ClueCriteria = field(default_factory=ClueCriteria)
    footprint: FootprintCriteria = field(default_factory=FootprintCriteria)
    stiffness_map: StiffnessMapCriteria = field(default_factory=StiffnessMapCriteria)
    design: DesignCriteria = field(default_factory=DesignCriteria)

    @property
    def version(self) -> str:
        """A revision and a digest of all names and values, as in "1-0123456789ab"."""
        text = json.dumps(asdict(self), sort_keys=True)
        return f"{_REVISION}-{hashlib.sha256(text.encode()).hexdigest()[:12]}"

    def to_json(self) -> dict[str, str]:
        """Plain values that a report and a model carry."""
        return {"version": self.version}


CRITERIA = Criteria()
"""The thresholds that the diagnosis reads."""


@dataclass(frozen=True, kw_only=True)
class CriterionRow:
    """One threshold in words.

    Attributes:
        name: "topic.field", as in `CRITERIA`.
        value: as text; values of a tuple with commas between them.
        unit: in SI symbols; "1" for a plain number.
        meaning: what it decides.
        source: "measured: ...", "derived: ...", "reference: ...", or "chosen, not derived".
    """

    name: str
    value: str
    unit: str
    meaning: str
    source: str


def criteria_rows(criteria: Criteria = CRITERIA) -> Iterator[CriterionRow]:
    """Yield every threshold as a row of a table, topic by topic."""
    for topic in fields(criteria):
        group = getattr(criteria, topic.name)
        for item in fields(group):
            value = getattr(group, item.name)
            shown = value if isinstance(value, tuple) else (value,)
            yield CriterionRow(
                name=f"{topic.name}.{item.name}",
                value=", ".join(f"{number:.4g}" for number in shown),
                unit=item.metadata["unit"],
                meaning=item.metadata["meaning"],
                source=item.metadata["source"],
            )
