"""The accuracy that the paper states of its own numbers, in one place.

Section 4: mass balance "is generally satisfied within a few percentage points, which was deemed satisfactory
considering numerical inaccuracies from time and spatial discretization"; errors "of the order of a few percent" are
"less than the error due to discretization". A few is taken as up to five. Section 3.3.2: the transient, to 0.1 %.
"""

FEW, FEW_WORDS = 0.05, "a few percent: up to five"
TRANSPORT, TRANSPORT_WORDS = 0.001, "0.1 %, the paper's accuracy of transport"
