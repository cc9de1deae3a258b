"""Which effects a scene calls for: by facts where they settle it, else by small paired renderings (`docs/effects.md`).

`facts` says what a scene has no occasion for, `without` what is rendered where an effect is left out, `probe` measures
what it contributes, and `planner` decides.
"""
