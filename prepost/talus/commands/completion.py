"""`talus completion bash`: commands, options and choices for the shell, from the parser itself."""

import argparse

SCRIPT = """# eval "$(talus completion bash)", or ~/.local/share/bash-completion/completions/talus
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


def register(commands: argparse._SubParsersAction) -> None:
    """Add `completion`."""
    new = commands.add_parser("completion", help="completion of the command line for a shell")
    new.add_argument("shell", choices=["bash"])
    new.set_defaults(run=completion)


def completion(options: argparse.Namespace) -> int:
    """Print the script."""
    from talus.cli import build_parser

    rows = [f'    ["{path}"]="{" ".join(words)}"' for path, words in words_of(build_parser())]
    print(SCRIPT % "\n".join(rows), end="")
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
