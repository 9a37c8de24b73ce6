#!/bin/bash
# Kills `lamina surface --checkpoint` at random moments, by KILL and TERM in turn, and lets it go on: no partial mesh
# may ever lie under the final name, and in the end the mesh is that of an undisturbed run. Specks stay in both: runs
# with a checkpoint leave none out unasked.
#
# usage: kill_resume.sh LAMINA POINTS [ROUNDS=100] [SEED]
set -u
lamina=$1 points=$2 rounds=${3:-100} seed=${4:-1}
RANDOM=$seed
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "kill_resume: $*" >&2; exit 1; }

"$lamina" surface "$points" -o "$work/whole.ply" --prune 0 --quiet || fail "the undisturbed run failed"
began=$(date +%s%N)
"$lamina" surface "$points" -o "$work/whole2.ply" --checkpoint "$work/dir" --prune 0 --quiet || fail "with a checkpoint it failed"
took=$((($(date +%s%N) - began) / 1000000)) # ms
cmp -s "$work/whole.ply" "$work/whole2.ply" || fail "the mesh with a checkpoint is another"

kills=0 resumed=0 afresh=0
for ((round = 0; round < rounds; ++round)); do
  rm -f "$work/out.ply"
  signal=$([ $((round % 2)) = 0 ] && echo KILL || echo TERM)
  # Two kills at most, so that runs that have gone on are killed, too.
  for ((turn = 0; turn < 1 + RANDOM % 2; ++turn)); do
    "$lamina" surface "$points" -o "$work/out.ply" --checkpoint "$work/dir" --resume --prune 0 --quiet 2> "$work/err" &
    id=$!
    # Half of the kills come after a part was finished: then there is something to go on with.
    if [ $((RANDOM % 2)) = 0 ]; then
      while kill -0 "$id" 2> /dev/null && ! ls "$work/dir"/part_*.lmesh > /dev/null 2>&1; do sleep 0.01; done
    fi
    sleep "$(awk -v most="$took" -v r="$RANDOM" 'BEGIN { print 0.6 * most * r / 32768 / 1000 }')"
    kill -s "$signal" "$id" 2> /dev/null && kills=$((kills + 1))
    wait "$id" 2> /dev/null
    code=$?
    if [ -e "$work/out.ply" ]; then
      cmp -s "$work/whole.ply" "$work/out.ply" || fail "round $round: a mesh that is not whole ($signal, code $code)"
    elif [ "$code" = 0 ]; then
      fail "round $round: success without a mesh"
    elif [ "$signal" = TERM ] && [ "$code" != 1 ] && [ "$code" != 143 ]; then
      fail "round $round: code $code after TERM: $(cat "$work/err")"
    fi
  done
  if ls "$work/dir"/part_*.lmesh > /dev/null 2>&1; then resumed=$((resumed + 1)); else afresh=$((afresh + 1)); fi
  "$lamina" surface "$points" -o "$work/out.ply" --checkpoint "$work/dir" --resume --prune 0 --quiet || fail "round $round: going on failed"
  cmp -s "$work/whole.ply" "$work/out.ply" || fail "round $round: the mesh is another"
  [ ! -e "$work/dir" ] || fail "round $round: the checkpoint is still there"
done
rest=$(find "$work" -name '.*.partial-*' ! -name '.out.ply.partial-*' | head)
[ -z "$rest" ] || fail "left behind: $rest"
echo "$kills kills in $rounds rounds: every mesh whole, $resumed rounds went on with finished parts, $afresh without"
