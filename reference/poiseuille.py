"""Plane Poiseuille flow, the exact solution of (1)-(5) in a clean channel.

Between walls at y = 0 and y = W, (1) is nu/g u_x'' = dphi/dx. With u_x = 0 on the walls

    u_x(y) = 6 u_ave (y/W) (1 - y/W),        -dphi/dx = 12 nu u_ave / (g W^2)

since u_x'' = -12 u_ave / W^2 and the mean of 6 s (1 - s) over 0..1 is one. The head loss over a length L is 12 nu u_ave
L / (g W^2), hence the conductivity K = u_ave L / dphi = g W^2 / (12 nu).
"""


def velocity(y, width, mean_velocity=1.0):
    """u_x at heights y, in the unit of mean_velocity."""
    return 6 * mean_velocity * (y / width) * (1 - y / width)


def head_loss(length, width, mean_velocity, viscosity):
    """Loss of head over a length; viscosity is nu/g."""
    return 12 * viscosity * mean_velocity * length / width**2


def conductivity(width, viscosity):
    """u_ave L / dphi of a clean channel; viscosity is nu/g."""
    return width**2 / (12 * viscosity)
