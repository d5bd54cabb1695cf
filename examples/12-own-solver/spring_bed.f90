!> A solid of another make: the plate on springs of spring_bed.c, in Fortran (manual/own-solver.md).
program spring_bed
  use talus_kinds
  use talus_verbs
  use talus_port_names
  use talus_scalars
  use talus_port_partner
  implicit none
  real(wp), parameter :: w = 0.02_wp, h = 0.01_wp, x(3, 8) = reshape([-w, -w, -h, w, -w, -h, &
    w, w, -h, -w, w, -h, -w, -w, 0*w, w, -w, 0*w, w, w, 0*w, -w, w, 0*w], [3, 8])
  integer(i8), parameter :: node(8, 1) = reshape(int([1, 2, 3, 4, 5, 6, 7, 8], i8), [8, 1])
  type(port_type) :: port
  type(set_type), allocatable :: set, sets(:)
  real(wp) :: stiffness, trial = 0, accepted = 0, rate, scalars(1, scalar_count) = 0
  character(len=200) :: path
  integer :: k, code
  call get_command_argument(1, path)
  open (unit=10, file=path, status='old')
  read (10, *) stiffness  ! N/m
  call port%open()
  do while (port%next('report,load,solve,reject,rehearsal'))
    select case (port%verb)
    case (verb_hello)
      call port%put_hello('spring_bed', '1.0', 'none')
    case (verb_describe)
      if (port%text(field_what) == what_mesh) then
        call port%put_mesh(cell_hex8, x, node)
      else if (port%text(field_group) == 'top') then
        call port%put_facets(cell_quad4, node(5:, :))
      else
        call port%fail(status_system, 'P301', 'the bed has a mesh and facets top', 'name them')
      end if
    case (verb_select)
      set = port%select_set(8_i8)
      call port%put_nodes(set, 0*set%id*w, stiffness/4 + 0*set%id, spread(set%id <= 4, 1, 3) .or. &
        spread([.true., .true., .false.], 2, size(set%id)))
    case (verb_ready, verb_solve)
      if (port%verb == verb_solve) trial = 0
      call port%list_sets(sets)
      do k = 1, merge(size(sets), 0, port%verb == verb_solve)
        trial = trial + sum(matmul([0, 0, 1], port%load_on(sets(k))), sets(k)%id > 4)/stiffness
      end do
      rate = (trial - accepted)/max(port%t1() - port%t0(), tiny(w))
      scalars(1, [scalar_elastic, scalar_boundary]) = stiffness*trial**2/2
      call port%put_step(1_i8, scalars)
      do k = 1, size(sets)
        associate (up => spread([0, 0, 1], 2, size(sets(k)%id))*spread(sets(k)%id/5, 1, 3))
          call port%put_motion(sets(k), trial*up, rate*up, 0*w*up)
        end associate
      end do
    case (verb_write)
      call port%put_text(field_path, '')  ! there is nothing to write
    end select
    if (port%verb == verb_accept) accepted = trial
    if (port%verb == verb_reject) trial = accepted
    call port%reply()
  end do
  call port%leave(code)
  stop code, quiet=.true.
end program spring_bed
