"""Repair of surfaces as CT and scanners give them: open, doubled, flipped, crossing, too fine."""
