!> The deck reader: what it accepts, what it returns, and every fault with its place.
program test_talus_deck
  use talus_kinds, only: wp, i4
  use talus_text, only: string_type, str, join
  use talus_errors, only: error_list_type
  use talus_deck, only: deck_type
  use talus_deck_table, only: key_table_type
  use talus_system, only: process_id
  use talus_test, only: test_type
  implicit none
  character(len=*), parameter :: lf = achar(10), cr = achar(13), tab = achar(9)
  type(test_type) :: test
  type(key_table_type) :: table
  type(deck_type) :: deck
  type(error_list_type) :: errors
  character(len=:), allocatable :: path

  path = '/tmp/talus_test_'//str(int(process_id(), i4))//'.nml'
  call make_table()
  call good_decks()
  call defaults()
  call other_forms()
  call syntax_faults()
  call name_faults()
  call value_faults()
  call file_faults()
  call several_faults()
  call rule_faults()
  call set_up_faults()
  call odd_decks()
  call remove()
  call test%finish()

contains

  subroutine make_table()
    call table%init('talus-test', 3)
    call table%add_group('run', 6, 'What is run.', required=.true.)
    call table%add_key('title', 'string', '', 'Title.')
    call table%preset('none')
    call table%add_key('t_end', 'real', 's', 'End.')
    call table%need()
    call table%bounds(above=0.0_wp)
    call table%magnitude(1.0e-18_wp, 1.0e12_wp)
    call table%add_key('gravity', 'real', 'm/s2', 'Gravity.')
    call table%sized(3, 3)
    call table%preset('0.0|0.0|-9.81')
    call table%add_key('threads', 'integer', '', 'Threads.')
    call table%bounds(min=0.0_wp, max=64.0_wp)
    call table%add_key('verbose', 'logical', '', 'Talk.')
    call table%preset('.true.')
    call table%add_key('damping', 'real', '1/s', 'Damping.')
    call table%bounds(min=0.0_wp)
    call table%words('full', [-1.0_wp])
    call table%add_group('wall', 5, 'A wall.', repeats=.true.)
    call table%add_key('id', 'string', '', 'Name.')
    call table%need()
    call table%add_key('kind', 'string', '', 'Kind.')
    call table%allow('plane|sphere')
    call table%add_key('grains', 'integer', '', 'Ids.')
    call table%sized(1, huge(1_i4))
    call table%add_key('file', 'file', '', 'A file.')
    call table%add_key('fields', 'string', '', 'Fields.')
    call table%sized(1, 3)
    call table%add_group('limits', 1, 'Limits.')
    call table%add_key('overlap', 'real', '', 'Overlap.')
    call table%preset('0.1')
    call table%bounds(above=0.0_wp, max=1.0_wp)
  end subroutine make_table

  !> A table whose keys depend on each other.
  subroutine make_rules()
    call table%init('talus-test', 3)
    call table%add_group('step', 9, 'Steps.', required=.true.)
    call table%add_key('kind', 'string', '', 'Kind.')
    call table%preset('static')
    call table%allow('static|newmark|hht')
    call table%choices_were('average|alpha', 'newmark|hht')
    call table%add_key('beta', 'real', '', 'Beta.')
    call table%preset('0.25')
    call table%only_with('kind', 'newmark|hht')
    call table%add_key('modes', 'integer', '', 'Modes.')
    call table%need()
    call table%only_with('kind', 'hht')
    call table%add_key('path', 'string', '', 'Path.')
    call table%preset('load')
    call table%allow('load|arc|curve')
    call table%choice_with('arc', 'kind', 'static')
    call table%add_key('share', 'real', '', 'Share.')
    call table%only_with('kind', 'static')
    call table%only_with('path', 'arc|curve')
    call table%need_with('path', 'curve')
    call table%add_key('lower', 'real', '', 'Lower.')
    call table%needs('upper')
    call table%add_key('upper', 'real', '', 'Upper.')
    call table%needs('lower')
    call table%was('top|ceiling')
    call table%add_key('middle', 'real', '', 'Middle.')
    call table%excludes('lower|upper')
    call table%add_key('title', 'string', '', 'Title.')
    call table%add_group('tool', 4, 'A tool.', repeats=.true.)
    call table%group_was('instrument')
    call table%one_of('file|disc')
    call table%one_of('speed|force', at_least=.true.)
    call table%add_key('file', 'string', '', 'File.')
    call table%add_key('disc', 'real', '', 'Disc.')
    call table%add_key('speed', 'real', '', 'Speed.')
    call table%only_with('step.kind', 'newmark|hht')
    call table%add_key('force', 'real', '', 'Force.')
    call table%add_group('damper', 1, 'A damper.')
    call table%group_with('step.kind', 'newmark|hht')
    call table%add_key('rate', 'real', '', 'Rate.')
  end subroutine make_rules

  !> Rules of the table: what belongs to a choice, needs or excludes, and what has a new name.
  subroutine rule_faults()
    call make_rules()
    call expect('belongs', '&step kind = ''newmark'', beta = 0.3 / &damper rate = 1 /', '')
    call expect('of another choice', '&step kind = ''static'','//lf//'beta = 0.3 /', 'D024:2:1')
    call says(1, 'beta has no meaning with kind = ''static'''//lf)
    call says(1, '   2 | beta = 0.3 /'//lf//'        | ^~~~')
    call says(1, 'leave it out; it belongs to kind = ''newmark'', ''hht''')
    call expect('of another default', '&step beta = 0.3 /', 'D024:1:7')
    call says(1, 'with kind = ''static'' (default)')
    call expect('chooser mistyped', '&step kidn = ''newmark'', beta = 0.3 /', 'D011:1:7')
    call expect('chooser faulty', '&step kind = ''newmrk'', beta = 0.3 /', 'D017:1:14')
    call expect('one of two conditions', '&step kind = ''newmark'', share = 1 modes = 1 /', &
                'D024:1:25 D024:1:35')
    call says(1, 'share has no meaning with kind = ''newmark''')
    call expect('the other condition', '&step share = 1 /', 'D024:1:7')
    call says(1, 'path = ''load'' (default)')
    call expect('both conditions', '&step share = 1, path = ''arc'' /', '')
    call expect('required where it belongs', '&step kind = ''hht'' /', 'D013:1:7')
    call says(1, 'group &step needs key ''modes'' with kind = ''hht''')
    call says(1, '^~~~~~~~~~~~')
    call says(1, 'modes: Modes.')
    call expect('required with a choice', '&step path = ''curve'' /', 'D013:1:7')
    call expect('perhaps mistyped', '&step kind = ''hht'', mods = 3 /', 'D011:1:21')
    call expect('choices that do not go together', '&step kind = ''newmark'', path = ''arc'' /', &
                'D026:1:32')
    call says(1, 'path = ''arc'' does not go with kind = ''newmark''')
    call says(1, 'it goes with kind = ''static''')
    call expect('needs', '&step lower = 1 /', 'D013:1:7')
    call says(1, 'key ''lower'' needs key ''upper''')
    call expect('needs and has', '&step lower = 1, upper = 2 /', '')
    call expect('excludes', '&step middle = 1,'//lf//' lower = 1, upper = 2 /', &
                'D025:2:2 D025:2:13')
    call says(1, 'middle (line 1) and lower are both given')
    call expect('none of two', '&step / &tool force = 1 /', 'D013:1:9')
    call says(1, 'group &tool needs one of the keys ''file'', ''disc''')
    call expect('both of two', '&step / &tool disc = 1, file = ''a'', force = 1 /', 'D025:1:25')
    call says(1, 'disc (line 1) and file are both given')
    call expect('at least one', '&step kind = ''newmark'' / &tool disc = 1 /', 'D013:1:26')
    call says(1, 'one or more of the keys ''speed'', ''force''')
    call expect('one that belongs here', '&step / &tool disc = 1 /', 'D013:1:9')
    call says(1, 'needs key ''force''')
    call expect('chooser of another group', '&step / &tool disc = 1, speed = 2, force = 1 /', &
                'D024:1:25')
    call says(1, 'speed has no meaning with kind = ''static'' of &step (default)')
    call expect('group of another choice', '&damper rate = 1 / &step kind = ''static'' /', &
                'D024:1:1')
    call says(1, 'group &damper has no meaning with kind = ''static'' of &step')
    call expect('chooser in a group that is missing', '&damper rate = 1 /', 'D010')
    call old_names()
    call make_table()
  end subroutine rule_faults

  subroutine old_names()
    type(string_type), allocatable :: lines(:)
    call expect('old key', '&step lower = 1, top = 2 /', 'D023:1:18')
    call says(1, 'key ''top'' is now called ''upper''')
    call says(1, 'write upper = ...')
    call expect('older key, checked as the new one', '&step lower = 1, ceiling = ''a'' /', &
                'D023:1:18 D014:1:28')
    call expect('old and new key', '&step lower = 1, top = 2, upper = 2 /', 'D023:1:18 D012:1:27')
    call expect('old group', '&step / &instrument disc = 1, frce = 1 /', 'D023:1:9 D011:1:31')
    call says(1, 'group &instrument is now called &tool')
    call expect('old choice', '&step kind = ''average'' /', 'D023:1:14')
    call says(1, 'kind = ''average'' is now called ''newmark''')
    call expect('echo', '&step kind = ''newmark'' /', '')
    call deck%echo(lines)
    call test%check_text('defaults that mean something', join(lines, '|'), &
                         '&step|  kind             = ''newmark''|'// &
                         '  beta             = 0.25  (default)|'// &
                         '  path             = ''load''  (default)|/')
    call expect('echo', '&step path = ''arc'' /', '')
    call deck%echo(lines)
    call test%check_text('those that mean nothing are left out', join(lines, '|'), &
      '&step|  kind             = ''static''  (default)|  path             = ''arc''|/')
  end subroutine old_names

  !> Write a text as it is and read it as a deck.
  subroutine read_text(text)
    character(len=*), intent(in) :: text
    integer :: unit
    call remove()
    open (newunit=unit, file=path, access='stream', form='unformatted', status='new')
    write (unit) text
    close (unit)
    call errors%clear()
    call deck%read(path, table, errors)
  end subroutine read_text

  subroutine remove()
    integer :: unit, stat
    open (newunit=unit, file=path, status='old', iostat=stat)
    if (stat == 0) close (unit, status='delete')
  end subroutine remove

  !> A deck has exactly these faults: codes and places 'D011:1:5 D014:2:7' in order.
  subroutine expect(name, text, faults)
    character(len=*), intent(in) :: name, text, faults
    character(len=:), allocatable :: found, place
    integer(i4) :: k, cut
    call read_text(text)
    found = ''
    do k = 1, errors%count
      place = errors%item(k)%place
      cut = index(place, lf)
      if (cut > 0) place = place(:cut - 1)
      if (k > 1) found = found//' '
      found = found//errors%item(k)%code//place(len(path) + 1:)
    end do
    call test%check_text(name, found, faults)
  end subroutine expect

  !> The last fault read has this text in message, place or hint.
  subroutine says(k, piece)
    integer(i4), intent(in) :: k
    character(len=*), intent(in) :: piece
    if (errors%count < k) then
      call test%check('fault '//str(k)//' is there: '//piece, .false.)
    else
      call test%check('fault '//str(k)//' says: '//piece//' in '//errors%text(k), &
                      index(errors%text(k), piece) > 0)
    end if
  end subroutine says

  subroutine good_decks()
    character(len=:), allocatable :: text
    real(wp) :: value
    real(wp), allocatable :: values(:)
    integer(i4), allocatable :: ids(:)
    integer(i4) :: number
    logical :: flag
    type(string_type), allocatable :: names(:)

    call expect('good', '! a comment with ''quotes" and a / and &run'//lf// &
                '&RUN title = ''it''''s a / & b ! c'', T_end=1.5d-3 ! more'//lf// &
                '  gravity = 1, -2.0'//lf//tab//'3e0, threads = +4 verbose = false,'//lf// &
                '/'//lf// &
                '&wall id="say ""hi""" grains = 3 1,'//lf//' 2 /&wall id = ''two'', '// &
                'fields=''a'',''b'' /', '')
    call test%check('counts', deck%count('run') == 1 .and. deck%count('wall') == 2 &
                    .and. deck%count('limits') == 0)
    call deck%get('run', 1, 'title', text)
    call test%check_text('string', text, 'it''s a / & b ! c')
    call deck%get('run', 1, 't_end', value)
    call test%check_close('real', value, 1.5e-3_wp, 0.0_wp)
    call deck%get('run', 1, 'gravity', values)
    call test%check_text('list', str(values), '1, -2, 3')
    call deck%get('run', 1, 'threads', number)
    call test%check('integer', number == 4)
    call deck%get('run', 1, 'verbose', flag)
    call test%check('logical', .not. flag)
    call deck%get('wall', 1, 'id', text)
    call test%check_text('double quotes', text, 'say "hi"')
    call deck%get('wall', 1, 'grains', ids)
    call test%check_text('integers', str(ids), '3, 1, 2')
    call deck%get('wall', 2, 'grains', ids)
    call test%check('none given', size(ids) == 0)
    call deck%get('wall', 2, 'fields', names)
    call test%check_text('strings', join(names, '+'), 'a+b')
    call test%check('given', deck%given('run', 1, 't_end') &
                    .and. .not. deck%given('run', 1, 'damping'))
    call test%check('given in one of two', deck%given('wall', 1, 'grains') &
                    .and. .not. deck%given('wall', 2, 'grains'))
  end subroutine good_decks

  subroutine defaults()
    character(len=:), allocatable :: text
    real(wp) :: value
    real(wp), allocatable :: values(:)
    logical :: flag
    type(string_type), allocatable :: lines(:)

    call expect('few', '&run t_end = 1 /', '')
    call deck%get('run', 1, 'title', text)
    call test%check_text('default string', text, 'none')
    call deck%get('run', 1, 'gravity', values)
    call test%check_text('default list', str(values), '0, 0, -9.81')
    call deck%get('run', 1, 'verbose', flag)
    call test%check('default logical', flag)
    call deck%get('limits', 1, 'overlap', value)
    call test%check_close('default of an absent group', value, 0.1_wp, 0.0_wp)
    call deck%get('run', 1, 'damping', value)
    call test%check_close('no default', value, 0.0_wp, 0.0_wp)
    call deck%echo(lines)
    call test%check_text('echo', join(lines, '|'), &
                         '&run|  title            = ''none''  (default)|'// &
                         '  t_end            = 1  [s]|'// &
                         '  gravity          = 0.0, 0.0, -9.81  [m/s2]  (default)|'// &
                         '  verbose          = .true.  (default)|/|'// &
                         '&limits|  overlap          = 0.1  (default)|/')
    call expect('word', '&run t_end = 1, damping = ''full'' /', '')
    call deck%get('run', 1, 'damping', value)
    call test%check_close('word stands for its value', value, -1.0_wp, 0.0_wp)
  end subroutine defaults

  subroutine other_forms()
    character(len=16) :: hash
    character(len=:), allocatable :: text

    call expect('unix', '&run t_end = 1'//lf//'/'//lf//'&wall id = ''a'' /'//lf, '')
    hash = deck%hash()
    call expect('dos', '&run t_end = 1'//cr//lf//'/'//cr//lf//'&wall id = ''a'' /'//cr//lf, '')
    call test%check_text('same hash', deck%hash(), hash)
    call test%check('last group read', deck%count('wall') == 1)
    call expect('no final newline', '&run t_end = 1'//lf//'/'//lf//'&wall id = ''a'' /', '')
    call test%check_text('same hash again', deck%hash(), hash)
    call expect('byte order mark', char(239)//char(187)//char(191)//'&run t_end = 1 /', '')
    call expect('other text', '&run t_end = 2 /', '')
    call test%check('other hash', deck%hash() /= hash)
    call expect('all on one line', '&wall id=''a''/&run t_end=1/! end', '')
    call expect('numbers', '&run t_end = .5, gravity = 1. -1.e-3 +2D+2, threads = 007 /', '')
    call expect('utf-8', '&run title = '''//char(195)//char(182)//''', qqq = 1, t_end = 1 /', &
                'D011:1:19')
    call says(1, '  |                   ^~~')
    call expect('tab', tab//'&run t_end = 1'//tab//'titel = ''x'' /', 'D011:1:17')
    call says(1, '    1 |  &run t_end = 1 titel = ''x'' /'//lf//'        |                 ^~~~~')
    call expect('string with a quote at its end', '&run t_end=1 title = ''a'''''' /', '')
    call deck%get('run', 1, 'title', text)
    call test%check_text('doubled quote', text, 'a''')
    call expect('empty string', '&run t_end=1 title = '''' /', '')
    call deck%get('run', 1, 'title', text)
    call test%check_text('empty', text, '')
  end subroutine other_forms

  subroutine syntax_faults()
    call expect('stray text', 'hello'//lf//'&run t_end = 1 /', 'D004:1:1')
    call says(1, '^~~~~')
    call expect('stray behind', '&run t_end = 1 / threads = 2 ! c'//lf//'&wall id=''a'' /', &
                'D004:1:18')
    call expect('stray block is one fault', '&run t_end = 1 /'//lf//'a = 1'//lf//'b = 2'//lf, &
                'D004:2:1')
    call expect('stray twice', 'x'//lf//'&run t_end = 1 /'//lf//'y', 'D004:1:1 D004:3:1')
    call expect('two slashes', '&run t_end = 1 / /', 'D004:1:18')
    call expect('missing quote', '&run title = ''abc, t_end = 1 /'//lf//'&wall id = ''a'' /', &
                'D005:1:14')
    call says(1, 'close the string with ''')
    call expect('missing quote, more lines', '&run title = "abc,'//lf//'t_end = 1 /', 'D005:1:14')
    call expect('missing quote in the middle', '&run t_end=1 /'//lf// &
                '&wall id = ''abc, kind = ''plane'' /'//lf//'&limits overlap = 2.0 /', &
                'D005:2:12 D016:3:19')
    call expect('missing slash', '&run t_end = 1'//lf//'&wall id = ''a'' /', 'D006:2:1')
    call says(1, 'group &run (line 1) is still open at &wall')
    call expect('missing slash at the end', '&run t_end = 1 /'//lf//'&wall id = ''a''', 'D006:2:15')
    call says(1, 'the end of the deck')
    call expect('no equals', '&run t_end 1 /', 'D013:1:1 D007:1:6')
    call expect('no key', '&run = 3, t_end = 1 /', 'D007:1:6')
    call expect('two commas', '&run t_end = 1, gravity = 1,, 2, 3 /', 'D007:1:29')
    call expect('comma first', '&run t_end = 1, gravity = , 1, 2, 3 /', 'D007:1:27')
    call expect('string alone', '&run ''abc'' t_end = 1 /', 'D007:1:6')
    call expect('quoted key', '&run ''t_end'' = 1 /', 'D013:1:1 D007:1:6')
  end subroutine syntax_faults

  subroutine name_faults()
    call expect('unknown group', '&run t_end=1 /'//lf//'  &wal id = ''a'' /', 'D008:2:3')
    call says(1, 'did you mean ''wall''?')
    call says(1, '    2 |   &wal id = ''a'' /'//lf//'        |   ^~~~')
    call expect('strange group', '&run t_end=1 /'//lf//'&qqq /', 'D008:2:1')
    call says(1, 'groups of talus-test: run, wall, limits')
    call expect('mistyped required group', '&rum t_end=1 /', 'D008:1:1')
    call expect('no name', '&run t_end=1 /'//lf//'& wall id=''a'' /', 'D008:2:1 D007:2:3')
    call expect('given twice', '&run t_end=1 /'//lf//'&run t_end = 2 /', 'D009:2:1')
    call says(1, 'first on line 1')
    call expect('missing group', '&wall id = ''a'' /', 'D010')
    call says(1, 'group &run is missing')
    call expect('unknown key', '&run t_end = 1, thraeds = 2 /', 'D011:1:17')
    call says(1, 'did you mean ''threads''?')
    call expect('key of another group', '&run t_end = 1, grains = 2 /', 'D011:1:17')
    call says(1, '''grains'' belongs to group &wall')
    call expect('strange key', '&run t_end = 1, qqq = 2 /', 'D011:1:17')
    call says(1, 'keys of &run: title, t_end')
    call expect('repeated key', '&run t_end = 1,'//lf//' T_END = 2 /', 'D012:2:2')
    call says(1, 'first on line 1')
    call expect('missing key', '&run threads = 1 /', 'D013:1:1')
    call says(1, 'needs key ''t_end''')
    call expect('mistyped required key', '&run tend = 1 /', 'D011:1:6')
  end subroutine name_faults

  subroutine value_faults()
    call expect('real for integer', '&run t_end=1 threads = 1.5 /', 'D014:1:24')
    call says(1, '1.5 is a real number')
    call expect('quoted number', '&run t_end = ''1.0'' /', 'D014:1:14')
    call says(1, 'without quotes: 1.0')
    call expect('bare string', '&run t_end=1 title = quartz /', 'D014:1:22')
    call says(1, 'write ''quartz''')
    call expect('bare path', '&run t_end=1 /&wall id=''a'' file = a/b.h5 /', 'D014:1:35')
    call says(1, 'a/b.h5 is without quotes')
    call expect('bare word for a word', '&run t_end=1 damping = full /', 'D014:1:24')
    call says(1, 'put a word in quotes: ''full''')
    call expect('wrong word', '&run t_end=1 damping = ''ful'' /', 'D014:1:24')
    call says(1, 'did you mean ''full''?')
    call expect('no number', '&run t_end = 1.0.0 /', 'D014:1:14')
    call expect('unit behind a number', '&run t_end = 1s /', 'D014:1:14')
    call expect('repeat count', '&run t_end=1 gravity = 3*0.0 /', 'D015:1:14 D014:1:24')
    call expect('no logical', '&run t_end=1 verbose = yes /', 'D014:1:24')
    call expect('quoted logical', '&run t_end=1 verbose = ''true'' /', 'D014:1:24')
    call expect('too few', '&run t_end=1 gravity = 0, 1 /', 'D015:1:14')
    call says(1, 'needs 3 values, 2 are given')
    call expect('too many', '&run t_end=1 gravity = 0, 1, 2, 3, 4 /', 'D015:1:33')
    call expect('no value', '&run t_end= /', 'D015:1:6')
    call says(1, 'needs 1 value, none is given')
    call expect('missing equals', '&run t_end=1 threads 3 /', 'D015:1:14')
    call says(1, 'is a ''='' missing after ''threads''?')
    call expect('above', '&run t_end = 0.0 /', 'D016:1:14')
    call says(1, 'it must be > 0')
    call expect('max', '&run t_end=1 threads = 65 /', 'D016:1:24')
    call says(1, 'it must be >= 0 and <= 64')
    call expect('min', '&run t_end=1 threads = -1 /', 'D016:1:24')
    call expect('at the bounds', '&run t_end=1 threads = 64 / &limits overlap = 1.0 /', '')
    call expect('too small', '&run t_end = 1e-19 /', 'D016:1:14')
    call says(1, 'quantities in s begin at 1e-18')
    call expect('too large', '&run t_end = 2e12 /', 'D016:1:14')
    call says(1, 'quantities in s end at 1e12')
    call expect('huge', '&run t_end = 1e999 /', 'D016:1:14')
    call expect('huge integer', '&run t_end=1 threads = 99999999999999999999 /', 'D016:1:24')
    call expect('choice', '&run t_end=1 /&wall id=''a'' kind = ''plan'' /', 'D017:1:35')
    call says(1, 'did you mean ''plane''?')
    call expect('nan', '&run t_end = NaN /', 'D019:1:14')
    call expect('infinity', '&run t_end=1 gravity = 0, -Inf, 0 /', 'D019:1:27')
  end subroutine value_faults

  subroutine file_faults()
    character(len=:), allocatable :: name
    call expect('missing file', '&run t_end=1 /'//lf//'&wall id=''a'' file = ''no.h5'' /', &
                'D018:2:21')
    call says(1, '/tmp/no.h5')
    call expect('folder for a file', '&run t_end=1 /'//lf//'&wall id=''a'' file = ''.'' /', &
                'D018:2:21')
    call says(1, 'is a folder')
    call expect('empty name', '&run t_end=1 /'//lf//'&wall id=''a'' file = '''' /', 'D018:2:21')
    name = path(6:)
    call expect('file beside the deck', '&run t_end=1 /&wall id=''a'' file = '''//name//''' /', '')
    call test%check_text('path', deck%path('wall', 1, 'file'), path)
    call expect('absolute file', '&run t_end=1 /&wall id=''a'' file = '''//path//''' /', '')
    call test%check_text('absolute path', deck%path('wall', 1, 'file'), path)
    call errors%clear()
    call deck%read('/tmp/no/such/deck.nml', table, errors)
    call test%check('no deck', errors%count == 1 .and. errors%item(1)%code == 'D001')
    call errors%clear()
    call deck%read('/tmp', table, errors)
    call test%check('a folder', errors%count == 1 .and. errors%item(1)%code == 'D001')
    call expect('binary', '&run t_end = 1 /'//achar(0)//achar(1), 'D002')
    call expect('empty', '', 'D003')
    call expect('only a comment', '! &run t_end = 1 /'//lf, 'D003')
  end subroutine file_faults

  subroutine several_faults()
    call expect('all in one go', 'stray'//lf//'&run titel = ''x'', t_end = -1, threads = 1.5,' &
                //lf// &
                ' gravity = 0, 0 /'//lf//'&wall kind = ''box'' /'//lf//'&blob /'//lf// &
                '&limits overlap = ''a''', &
                'D004:1:1 D011:2:6 D016:2:27 D014:2:41 D015:3:2 D013:4:1 D017:4:14 D008:5:1 '// &
                'D014:6:19 D006:6:22')
    call test%check('exit code', errors%exit_code() == 1)
  end subroutine several_faults

  subroutine set_up_faults()
    call read_text('&run t_end = 1 /'//lf//'&wall id = ''a'' /'//lf//'&wall id = ''a'', '// &
                   'grains = 1, 2 /')
    call deck%fault(errors, 'D100', 'two walls named a', 'wall', 2, 'id', 'rename one')
    call says(1, ':3:7'//lf//'      3 | &wall id = ''a'', grains = 1, 2 /'//lf// &
              '        |       ^~~~~~~~')
    call deck%fault(errors, 'D100', 'a wall needs a normal', 'wall', 2, 'kind', 'give it')
    call says(2, ':3:1')
    call deck%fault(errors, 'D100', 'no limits', 'limits', 1, '', 'give them')
    call test%check_text('file only', errors%item(3)%place, path)
  end subroutine set_up_faults

  !> Decks that are no decks must end in faults, not in a crash.
  subroutine odd_decks()
    call expect('only an ampersand', '&', 'D008:1:1 D006:1:2 D010')
    call expect('only a slash', '/', 'D004:1:1')
    call expect('only a quote', '&run ''', 'D005:1:6')
    call expect('csv', 'a,b,c'//lf//'1,2,3'//lf, 'D004:1:1')
    call read_text('&run t_end = 1, title = '''//repeat('x', 400)//''', thraeds = 2 /')
    call says(1, '...')
    call test%check('long line is cut', index(errors%text(1), repeat('x', 120)) == 0)
  end subroutine odd_decks
end program test_talus_deck
