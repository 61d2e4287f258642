# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Completes redag's commands and options in bash, by what --help lists, and otherwise names of files.
_redag() {
  local word=${COMP_WORDS[COMP_CWORD]} words=() names i help
  for ((i = 1; i < COMP_CWORD && i <= 2; ++i)); do
    [[ ${COMP_WORDS[i]} != -* ]] || break
    words+=("${COMP_WORDS[i]}")
  done
  help=$("${COMP_WORDS[0]}" "${words[@]}" --help 2>/dev/null) || return
  if [[ $word == -* ]]; then
    names=$(sed -n 's/^  \(-.*\)/\1/p' <<<"$help" | sed 's/  .*//' | grep -oE -- '--[a-z][a-z-]*')
  else
    names=$(sed -n '/^Commands:$/,/^$/s/^  \([a-z][a-z-]*\).*/\1/p' <<<"$help")
  fi
  mapfile -t COMPREPLY < <(compgen -W "$names" -- "$word")
}
complete -o default -F _redag redag
