"""When steps are made: the paper's updates, the midpoint rule with error control, and the loop of
both."""
