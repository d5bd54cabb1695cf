" Decks of Talus: K, or the mouse in gvim, tells what a key is.
if exists('b:did_ftplugin') | finish | endif
let b:did_ftplugin = 1
setlocal commentstring=!\ %s
let s:keys = json_decode(join(readfile(expand('<sfile>:p:h') . '/talus_keys.json'), "\n"))

function! TalusText(line, word) abort
  let l:word = tolower(a:word)
  let l:number = a:line
  while l:number > 0 && getline(l:number) !~# '^\s*&\w'
    let l:number -= 1
  endwhile
  let l:group = tolower(matchstr(getline(l:number), '^\s*&\zs\w\+'))
  return get(s:keys, l:group . '.' . l:word, get(s:keys, l:word, ''))
endfunction

function! TalusBalloon() abort
  return TalusText(v:beval_lnum, v:beval_text)
endfunction

nnoremap <buffer> K :echo TalusText(line('.'), expand('<cword>'))<CR>
if has('balloon_eval')
  setlocal balloonexpr=TalusBalloon() ballooneval
endif
