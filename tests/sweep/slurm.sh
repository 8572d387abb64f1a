#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Runs a sweep as an array of jobs by a Slurm of one node that this script starts, and compares the trajectories with
# those of a local run byte for byte.
#
#   tests/sweep/slurm.sh PROGRAM     exits with 77 (skipped) where Slurm or root is missing
#
# Debian: slurmctld slurmd slurm-client munge
set -euo pipefail
program=$(realpath "$1")
skip() {
  echo "slurm: skipped: $*"
  exit 77
}
export PATH=$PATH:/usr/sbin
for tool in slurmctld slurmd sbatch sinfo munged; do
  command -v "$tool" > /dev/null || skip "no $tool (Debian: slurmctld slurmd slurm-client munge)"
done
[ "$(id -u)" -eq 0 ] || skip "slurmd wants to be root"

work=$(mktemp -d)
started=()
finish() {
  [ ${#started[@]} -eq 0 ] || kill "${started[@]}" 2> /dev/null || true
  wait
  rm -rf --one-file-system "$work"
}
trap finish EXIT
fail() {
  echo "slurm: $*" >&2
  tail -n 20 "$work"/*.log >&2 || true
  exit 1
}

# munge lets nobody but its user write where its key and socket lie, up to the root.
chmod 755 "$work"
mkdir -m 755 "$work/munge"
mkdir -m 700 "$work/state" "$work/spool"
head -c 1024 /dev/urandom > "$work/munge/key"
chmod 600 "$work/munge/key"
munged --foreground --force --key-file "$work/munge/key" --socket "$work/munge/socket" --pid-file "$work/munge/pid" \
  --seed-file "$work/munge/seed" --log-file "$work/munged.log" 2> /dev/null &
started+=($!)

port() { python3 -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])'; }
name=$(hostname -s)
export SLURM_CONF=$work/slurm.conf
cat > "$SLURM_CONF" << EOF
ClusterName=dynslam
SlurmctldHost=$name(127.0.0.1)
SlurmctldPort=$(port)
SlurmdPort=$(port)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
SwitchType=switch/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
NodeName=$name NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
EOF
slurmctld -D > "$work/slurmctld.log" 2>&1 &
started+=($!)
slurmd -D > "$work/slurmd.log" 2>&1 &
started+=($!)
for attempt in $(seq 60); do
  [ "$(sinfo --noheader --format %T 2> /dev/null)" != idle ] || break
  [ "$attempt" -lt 60 ] || fail "the node did not come up"
  sleep 0.5
done

"$program" synth "$work/sequence" --frames 6 > /dev/null
cat > "$work/sweep.toml" << EOF
sequences = ["$work/sequence"]
modes = ["none", "geometric"]
out = "$work/slurm"
EOF
"$program" sweep "$work/sweep.toml" --jobs-to "$work/jobs.sh" --jobs-as slurm > /dev/null
timeout 120 sbatch --wait "$work/jobs.sh" || fail "sbatch ended with $?"
"$program" sweep "$work/sweep.toml" --gather > "$work/gather.log" || fail "not every job is done"
"$program" sweep "$work/sweep.toml" --out "$work/local" > "$work/local.log"
compared=0
while IFS= read -r trajectory; do
  cmp "$trajectory" "$work/slurm/${trajectory#"$work/local/"}" || fail "other bytes"
  compared=$((compared + 1))
done < <(find "$work/local" -name trajectory.txt)
[ "$compared" -eq 2 ] || fail "$compared trajectories instead of 2"
echo "slurm: an array of 2 tasks, the trajectories byte for byte those of a local run"
