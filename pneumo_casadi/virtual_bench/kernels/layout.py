"""Where what lies: states, what the piston may do, and the rows that a run writes."""

#: Position and velocity of the piston [m, m/s].
X, V = 0, 1
#: Chamber P and N: pressure [Pa] where the gas is polytropic, internal energy [J] otherwise.
GAS_P, GAS_N = 2, 3
#: Mass of gas in the chambers [kg]; used with the energy balance only.
MASS_P, MASS_N = 4, 5
#: Second mass behind the elastic joint [m, m/s].
X_2, V_2 = 6, 7
#: Supply reservoir [Pa] and flow of its regulator [kg/s].
P_SUPPLY, Q_REGULATOR = 8, 9
#: Pressure before the silencer [Pa].
P_EXHAUST = 10
#: Coil current [V], spool position [V] and spool velocity [V/s] of the valves.
SPOOL_P, SPOOL_N = 11, 14
#: Pressure in the sensors' lines [Pa] and its rate [Pa/s].
TAP_P, TAP_N = 17, 19
#: Pressures [Pa] and flows [kg/s] along the lines, from the valve to the chamber.
LINE_P, LINE_N = 21, 27
#: Cells of a line.
CELLS = 3
#: Integrals over the outer boundary: gas mass [kg], enthalpy and heat [J], work of all forces
#: on the piston but pressure [J], kinetic energy lost at the end stops [J].
IN_MASS, IN_ENERGY, LOST_WORK, LOST_IMPACT = 33, 34, 35, 36
#: What the walls of the chambers are warmer than their surroundings [K].
WALL_P, WALL_N = 37, 38
#: Film of lubricant under the seals, 1 where it takes friction down to 1/e.
FILM = 39
#: Mass beyond a play [m, m/s].
X_3, V_3 = 40, 41
#: Number of all these.
SIZE = 42

#: What the piston does: moves down or up, is held at rest, or moves on bristles.
DOWN, HELD, UP, FREE = -1, 0, 1, 2

#: Bristles (Iwan elements) and, last, the position to which their deflections belong.
BRISTLES = 4

#: Columns of a run: command P, N [V], pressure P, N [Pa], position [m] as the sensors show them.
ROW = 5
