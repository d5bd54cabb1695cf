!> Liquid among the grains: the grid of bricks, the liquid, and what one exchange leaves to the next
!! (theory-dem, Liquid among the grains).
module dem_pore_state
  use talus_kinds, only: wp, i4, i8
  implicit none
  private
  public :: pore_grid_type, pore_liquid_type, pore_fit_type, pore_partner_type, dem_pore_type
  public :: pore_tools_type, pore_tips_type, pore_mixing_type
  public :: drain_none, drain_pressure, drain_flux, by_partner
  public :: sum_swept, sum_inflow, sum_hull, sum_flow, sum_work, sum_darcy, sum_drag, &
    sum_exchange, sum_seepage, sum_partner, sum_tools, sum_held_drag, pore_sums

  integer(i4), parameter :: drain_none = 0, drain_pressure = 1, drain_flux = 2
  !> Rows of sums: volumes [m^3] that moving walls have swept and that came in through drains; work
  !! of walls and drains on the liquid, of the liquid on the grains; losses to Darcy's flow and to
  !! drag within bricks, and what the exchange itself takes [J]; volume out by Darcy's flow, a side,
  !! and where a partner holds the pressures; volume in from there. Work of bodies on the liquid
  !! where they do not move by forces, and of the drag on these [J].
  integer(i4), parameter :: sum_swept = 1, sum_inflow = 2, sum_hull = 3, sum_flow = 4, &
    sum_work = 5, sum_darcy = 6, sum_drag = 7, sum_exchange = 8, sum_seepage = 8, &
    sum_partner = 16, sum_tools = 17, sum_held_drag = 18, pore_sums = 18
  integer(i4), parameter :: by_partner = 7  !! of `hold`, behind the sides

  !> A box of equal bricks; nodes and bricks are counted along x first, then y, then z. Sides are
  !! x0, x1, y0, y1, z0, z1: (end, axis).
  type :: pore_grid_type
    integer(i4) :: bricks(3) = 0     !! along x, y, z
    real(wp) :: lower(3) = 0.0_wp    !! [m]
    real(wp) :: upper(3) = 0.0_wp    !! [m]
  end type pore_grid_type

  !> What the deck says of the liquid and its flow.
  type :: pore_liquid_type
    real(wp) :: density = 0.0_wp       !! [kg/m^3]
    real(wp) :: viscosity = 0.0_wp     !! [Pa s]
    real(wp) :: compliance = 0.0_wp    !! 1/K_f with its air [1/Pa]
    integer(i4) :: law = 0             !! of the permeability, see dem_pore_medium
    real(wp) :: permeability = 0.0_wp  !! of the constant law [m^2]
    real(wp) :: factor = 1.0_wp        !! on the permeability of any law [-]
  end type pore_liquid_type

  !> Cones of the penetrometers among the tools: their part of what these feel, up to the shoulder.
  !! The shaft has the rest.
  type :: pore_tips_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: tool(:)        !! (tips)
    real(wp), allocatable :: rest(:, :, :, :)  !! (3, 3, triangles, tips) from the tip [m]
    real(wp), allocatable :: moment(:, :, :)   !! (4, 4, shares) the cone's part of the tools' [m^3]
    real(wp), allocatable :: cut(:, :, :)      !! (3, nodes, tips) what it sweeps at sides [m^2]
    real(wp), allocatable :: gives(:, :, :)    !! (3, nodes, tips) what it compresses in all [m^2]
    real(wp), allocatable :: load(:, :)        !! (3, tips) of the pressure over the hydrostatic [N]
    real(wp), allocatable :: drag(:, :)        !! (3, tips) of grains in its bricks [N]
    real(wp), allocatable :: lift(:, :)        !! (3, tips) of the hydrostatic pressure [N]
  end type pore_tips_type

  !> Closed bodies in the grid, here: tools. Their motions and loads are those of the centre, then
  !! turns and moments about it. What lies in a brick is its share of a tool.
  type :: pore_tools_type
    integer(i4) :: n = 0
    integer(i4), allocatable :: body(:)        !! (tools) surface
    integer(i4), allocatable :: first(:)       !! (tools+1) triangles
    real(wp), allocatable :: rest(:, :, :)     !! (3, 3, triangles) from the centre at the start [m]
    real(wp), allocatable :: volume(:)         !! (tools) [m^3]
    real(wp), allocatable :: middle(:, :)      !! (3, tools) of the volume, as rest [m]
    real(wp), allocatable :: centre(:, :)      !! (3, tools) where the exchange began [m]
    real(wp), allocatable :: quat(:, :)        !! (4, tools) turn since the start there [-]
    real(wp), allocatable :: load(:, :)        !! (6, tools) -D'p [N], [N m]
    real(wp), allocatable :: drag(:, :)        !! (6, tools) of grains in its bricks [N], [N m]
    real(wp), allocatable :: lift(:, :)        !! (6, tools) of the hydrostatic pressure [N], [N m]
    real(wp), allocatable :: work(:)           !! (tools) of load and drag on it [J]
    integer(i4), allocatable :: start(:)       !! (bricks+1) first of a brick's shares
    integer(i4), allocatable :: tool(:)        !! (shares)
    real(wp), allocatable :: moment(:, :, :)   !! (4, 4, shares) integral of [1 x][1 x]' [m^3]
    real(wp), allocatable :: weight(:)         !! (bricks) of their volume in the fit, that of the
                                               !! grains in the volume which these leave [-]
    real(wp), allocatable :: cut(:, :, :)      !! (6, nodes, tools) what a motion sweeps at sides
    real(wp), allocatable :: gives(:, :, :)    !! (6, nodes, tools) what it compresses in all
    type(pore_tips_type) :: tips               !! of penetrometers
  end type pore_tools_type

  !> Grains by brick and the fit of a linear velocity to them; lengths within a brick are in its
  !! edges, from its centre.
  type :: pore_fit_type
    logical :: ready = .false.
    logical, allocatable :: counts(:)           !! (grains) not ghosts; not allocated: all count
    integer(i4), allocatable :: brick(:)        !! (grains) 0: outside the grid, -1: a ghost
    integer(i4), allocatable :: start(:)        !! (bricks+1) first of its grains
    integer(i4), allocatable :: grain(:)        !! by brick, in rising order
    real(wp), allocatable :: local(:, :)        !! (3, grains) place in the brick, as `grain` [-]
    real(wp), allocatable :: weight(:)          !! volume, as `grain` [m^3]
    real(wp), allocatable :: inverse_mass(:)    !! (grains) 0 where the motion is prescribed [1/kg]
    real(wp), allocatable :: inverse(:, :, :)   !! (4, 4, bricks) A^-1 [1/m^3]
    real(wp), allocatable :: yield(:, :, :)     !! (4, 4, bricks) A^-1 B A^-1 [1/kg]
    type(pore_tools_type) :: tools
  end type pore_fit_type

  !> A side of the grid that is a partner's: it moves as the partner says, and is impervious, or has
  !! the partner's pressures, or gives way to its own by a conductance. Nodal values are in the
  !! order of `node`, which rises.
  type :: pore_partner_type
    integer(i4) :: side = 0                      !! x0 x1 y0 y1 z0 z1, 0: none
    logical :: held = .false.                    !! the pressures are the partner's
    logical :: yields = .false.                  !! or liquid goes over by a conductance
    integer(i4), allocatable :: node(:)
    real(wp), allocatable :: p(:)                !! pressure over the hydrostatic; that of the last
                                                 !! exchange, where liquid goes over [Pa]
    real(wp), allocatable :: conduct(:)          !! liquid that goes over by pressure [m^3/Pa]
    real(wp), allocatable :: expected(:)         !! and that comes without one [m^3/s]
    real(wp), allocatable :: v(:)                !! velocity along the axis [m/s]
    real(wp), allocatable :: inflow(:)           !! since the interval began [m^3]
    real(wp), allocatable :: impulse(:)          !! on the side, along its normal [N s]
    real(wp) :: work = 0.0_wp                    !! of the side on the liquid in the interval [J]
  end type pore_partner_type

  !> Bricks, those beside them, and how fast their liquid mixes in the exchange under way.
  type :: pore_mixing_type
    integer(i4), allocatable :: corner(:, :)  !! (8, bricks) nodes
    integer(i4), allocatable :: beside(:, :)  !! (6, bricks) bricks across faces, 0: none
    real(wp), allocatable :: share(:)         !! (bricks) one over their number, 0 without any
    real(wp), allocatable :: rate(:)          !! (bricks) [m^3/(Pa s)]
  end type pore_mixing_type

  !> The whole.
  type :: dem_pore_type
    logical :: active = .false.
    type(pore_grid_type) :: grid
    type(pore_liquid_type) :: liquid
    integer(i4) :: every = 4                     !! steps an exchange
    integer(i4) :: refresh = 50                  !! exchanges between two counts of the pores
    logical :: fluctuation = .true.              !! drag of grains against their brick's mean
    logical :: free_surface = .true.             !! open bricks at a drain are still water
    integer(i4) :: wall(2, 3) = 0                !! plane on each side, 0: none
    integer(i4) :: drain(2, 3) = drain_none      !! what holds each side
    real(wp) :: drain_value(2, 3) = 0.0_wp       !! excess pressure [Pa], or flow inward [m/s]
    real(wp) :: drain_layer(2, 3) = 0.0_wp       !! thickness of the layer before it [m]
    real(wp), allocatable :: volume(:)           !! (grains) [m^3]
    real(wp), allocatable :: area(:)             !! (grains) surface [m^2]
    real(wp), allocatable :: carried(:)          !! (grains) liquid that moves with each [kg]
    logical :: open = .false.                    !! an exchange is under way
    real(wp) :: since = 0.0_wp                   !! when it began [s]
    real(wp) :: span = 0.0_wp                    !! how long it was meant to be [s]
    integer(i8) :: exchanges = 0                 !! begun so far
    real(wp), allocatable :: p(:)                !! (nodes) pressure over the hydrostatic [Pa]
    real(wp), allocatable :: omega(:)            !! (nodes) volume that is compressed [m^3]
    real(wp), allocatable :: start_x(:, :)       !! (3, grains) when it began [m]
    real(wp), allocatable :: held(:, :)          !! (3, grains) force -D'p [N]
    real(wp), allocatable :: drag(:, :)          !! (3, grains) force within bricks [N]
    real(wp), allocatable :: room(:)             !! (bricks) share that no tool is in [-]
    real(wp), allocatable :: porosity(:)         !! (bricks) of that [-]
    real(wp), allocatable :: first_porosity(:)   !! (bricks) at the start [-]
    real(wp), allocatable :: sauter(:)           !! (bricks) diameter of Sauter [m]
    real(wp), allocatable :: speed(:)            !! (bricks) |w|, as the law sees it [m/s]
    real(wp), allocatable :: mobility(:)         !! (bricks) k/viscosity [m^2/(Pa s)]
    integer(i4), allocatable :: hold(:)          !! (nodes) 0: free, else the side, or by_partner
    real(wp), allocatable :: hold_p(:)           !! (nodes) pressure where it is held [Pa]
    real(wp) :: stored = 0.0_wp                  !! p C p/2 at the end of the last exchange [J]
    real(wp) :: sums(pore_sums) = 0.0_wp         !! sum_... since the start
    real(wp) :: fastest(2) = 0.0_wp              !! largest Reynolds number, when [s]
    real(wp) :: changed(2) = 0.0_wp              !! largest change of a porosity, when [s]
    integer(i4) :: turns = 0                     !! of the solver, in the last exchange
    type(pore_partner_type) :: partner
    type(pore_mixing_type) :: mixing             !! not kept: made from the rest
    type(pore_fit_type) :: fit                   !! where the exchange began; made from start_x
  end type dem_pore_type
end module dem_pore_state
