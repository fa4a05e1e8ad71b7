"""Every threshold of the diagnosis with its unit, meaning and source."""

from palpate.diagnosis.criteria.criteria import CRITERIA, Criteria, CriterionRow, criteria_rows

__all__ = ["CRITERIA", "Criteria", "CriterionRow", "criteria_rows"]
