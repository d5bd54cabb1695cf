"""`talus completion SHELL`: commands, options and choices for a shell, from the parser itself."""

import argparse

BASH = """# eval "$(talus completion bash)", or ~/.local/share/bash-completion/completions/talus
_talus() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
  local path=talus files=yes k words
  local -A known=(
%s
  )
  for ((k = 1; k < COMP_CWORD; k++)); do
    [[ ${COMP_WORDS[k]} != -* && -n ${known["$path ${COMP_WORDS[k]}"]+is} ]] &&
      path="$path ${COMP_WORDS[k]}"
  done
  words=${known["$path"]}
  if [[ $before == -* && -n ${known["$path $before"]+is} ]]; then
    words=${known["$path $before"]}
    [[ -z $words ]] || files=
  fi
  [[ $path != talus && $word != -* ]] || files=
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word"; [[ -z $files ]] || compgen -f -- "$word")
}
complete -o filenames -F _talus talus
"""

ZSH = """#compdef talus
# eval "$(talus completion zsh)" behind compinit, or a file _talus in a folder of $fpath
_talus() {
  local word=$words[CURRENT] before=$words[CURRENT-1] trail=talus files=yes k key some
  local -A known
  known=(
%s
  )
  for ((k = 2; k < CURRENT; k++)); do
    key="$trail $words[k]"
    [[ $words[k] != -* ]] && (( ${+known[$key]} )) && trail=$key
  done
  some=$known[$trail] key="$trail $before"
  if [[ $before == -* ]] && (( ${+known[$key]} )); then
    some=$known[$key]
    [[ -z $some ]] || files=
  fi
  [[ $trail != talus && $word != -* ]] || files=
  compadd -- ${=some}
  [[ -z $files ]] || _files
}
[[ $zsh_eval_context[-1] == loadautofunc ]] && _talus "$@" || compdef _talus talus
"""
FISH = """# talus completion fish | source, or ~/.config/fish/completions/talus.fish
function __talus_known
  switch "$argv"
%s
    case '*'
      return 1
  end
end
function __talus_path
  set -l tokens (commandline -opc)
  set -l trail talus
  for token in $tokens[2..-1]
    if not string match -q -- '-*' $token; and __talus_known "$trail $token" >/dev/null
      set trail "$trail $token"
    end
  end
  if string match -q -- '-*' $tokens[-1]; and __talus_known "$trail $tokens[-1]" >/dev/null
    set trail "$trail $tokens[-1]"
  end
  echo $trail
end
function __talus_words
  __talus_known (__talus_path)
end
function __talus_no_files
  set -l trail (__talus_path)
  test "$trail" = talus; and return 0
  string match -q -- '* -*' $trail; and test -n (__talus_words | string collect; or echo)
end
complete -c talus -a '(__talus_words)'
complete -c talus -n __talus_no_files -f
"""
#: script of a shell, and its line of a path of commands and the words behind it
SHELLS = {
    "bash": (BASH, '    ["{0}"]="{1}"'),
    "zsh": (ZSH, '    "{0}" "{1}"'),
    "fish": (FISH, "    case '{0}'\n      string split -n ' ' -- '{1}'; return 0"),
}


def register(commands: argparse._SubParsersAction) -> None:
    """Add `completion`."""
    new = commands.add_parser("completion", help="completion of the command line for a shell")
    new.add_argument("shell", choices=list(SHELLS))
    new.set_defaults(run=completion)


def completion(options: argparse.Namespace) -> int:
    """Print the script."""
    from talus.cli import build_parser

    script, row = SHELLS[options.shell]
    rows = [row.format(path, " ".join(words)) for path, words in words_of(build_parser())]
    print(script % "\n".join(rows), end="")
    return 0


def words_of(parser: argparse.ArgumentParser, path: str = "talus") -> list[tuple[str, list[str]]]:
    """Return the words behind each path of commands, `talus pack cloud`, and behind its options.

    An option that takes a value has a path of its own, `talus render --color`, with its choices or
    nothing, where a file may stand.
    """
    own, below = [], []
    for action in parser._actions:
        own += [word for word in action.option_strings if word.startswith("--")]
        choices = [str(word) for word in action.choices or ()]
        if isinstance(action, argparse._SubParsersAction):
            for name, one in action.choices.items():
                below += words_of(one, f"{path} {name}")
        if not action.option_strings:
            own += choices
        elif action.nargs != 0:
            below += [(f"{path} {word}", choices) for word in action.option_strings]
    return [(path, own), *below]
