" A namelist file is a deck of Talus if it has one of its groups.
autocmd BufRead,BufNewFile *.nml
  \ if join(getline(1, 60), "\n") =~? '\(^\|\n\)\s*&\(particles\|program\|section\|mesh\|material\)\>' |
  \   setfiletype talus |
  \ endif
