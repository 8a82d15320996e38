#!/usr/bin/env bash
# A Slurm of one node on this machine, and on it the jobs of scenes/cluster: eight shares of a picture, one
# of whose tasks is killed and requeued, and a sweep. The merged picture must be that of one process.
#
# All that Slurm needs lives in a temporary folder, on ports and sockets of its own, and ends with this
# script.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# shellcheck source=scripts/packages.sh
. scripts/packages.sh

PATH=$PATH:/usr/sbin:/sbin
binaries=$PWD/target/debug
[ -z "${ETENDUE:-}" ] || binaries=$(dirname "$(realpath "$ETENDUE")")

# Without CI, not being able to is no failure, but is said.
skip() {
    echo "Slurm is not tested: $1" >&2
    [ -z "${CI:-}" ] && exit 0
    exit 1
}

[ "$(id -u)" -eq 0 ] || skip "its daemons want root."
for program in slurmctld slurmd munged; do
    command -v "$program" >/dev/null || missing=(slurm-wlm munge)
done
if [ ${#missing[@]} -gt 0 ]; then
    echo "missing: ${missing[*]} (to run a Slurm of one node)"
    install_packages "${missing[@]}" || skip "it could not be installed."
fi
# ETENDUE names a command that is built already, as the workspace's tests leave one.
[ -n "${ETENDUE:-}" ] || cargo build -p etendue-cli

pids=()
finish() {
    # shellcheck disable=SC2317
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait "${pids[@]}" 2>/dev/null || true
    rm -rf "${home:-}"
}
trap finish EXIT

# Slurm wants paths without blanks, and munge a folder that nobody else may write to.
home=$(mktemp -d)
chmod 755 "$home"
mkdir -p "$home"/{state,spool,jobs,munge}
sockets=$home/munge
head -c 128 /dev/urandom >"$sockets/key"
chmod 600 "$sockets/key"
munged --foreground --force --num-threads 2 --socket "$sockets/socket" --key-file "$sockets/key" \
    --log-file "$sockets/log" --pid-file "$sockets/pid" --seed-file "$sockets/seed" \
    >"$home/munged.out" 2>&1 &
pids+=($!)

host=$(hostname -s)
cat >"$home/slurm.conf" <<CONF
ClusterName=etendue
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=17817
SlurmdPort=17818
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$sockets/socket
CredType=cred/munge
StateSaveLocation=$home/state
SlurmdSpoolDir=$home/spool
SlurmctldPidFile=$home/slurmctld.pid
SlurmdPidFile=$home/slurmd.pid
SlurmctldLogFile=$home/slurmctld.log
SlurmdLogFile=$home/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
AccountingStorageType=accounting_storage/none
JobAcctGatherType=jobacct_gather/none
MpiDefault=none
ReturnToService=2
KillWait=2
MinJobAge=600
SchedulerParameters=sched_min_interval=0,batch_sched_delay=0
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
CONF
export SLURM_CONF=$home/slurm.conf

slurmctld -D >"$home/slurmctld.out" 2>&1 &
pids+=($!)
slurmd -D -N "$host" >"$home/slurmd.out" 2>&1 &
pids+=($!)

# wait_until SECONDS COMMAND...: until the command succeeds.
wait_until() {
    local left=$(($1 * 5))
    shift
    until "$@" >/dev/null 2>&1; do
        left=$((left - 1))
        if [ "$left" -le 0 ]; then
            echo "waited in vain for: $*" >&2
            tail -n 20 "$home"/*.out "$home"/*.log "$home"/jobs/*.log >&2 || true
            exit 1
        fi
        sleep 0.2
    done
}
is_ready() { sinfo -h -o %T | grep -qx -e idle -e mixed; }
is_done() { [ -z "$(squeue -h -j "$1")" ] || ! squeue -h -j "$1" -o %T | grep -qv COMPLETED; }

wait_until 60 is_ready
sinfo

scene=$PWD/scenes/first-light.json
settings=(--set 'camera.sensor.resolution=[160,160]' --set tracer.type=path --samples 64 --threads 1)
export PATH=$binaries:$PATH

job=$(sbatch --parsable --array=1-8 --chdir "$home/jobs" scenes/cluster/render.sbatch \
    "$scene" "$home/picture" "${settings[@]}")
is_rendering() { pgrep -f -- '--shard 2/8' >/dev/null; }
wait_until 120 is_rendering
# As on a node that fails: the render is killed outright, and the task begins anew.
pkill -KILL -f -- '--shard 2/8'
scontrol requeue "${job}_2"
echo "task 2 was killed and requeued"
wait_until 600 is_done "$job"
wait_until 60 test -e "$home/picture/etendue-manifest.json"

etendue render "$scene" -o "$home/whole" --quiet "${settings[@]}" >/dev/null
for file in "$home"/whole/*; do
    name=$(basename "$file")
    # The manifest tells when files were written.
    [ "$name" = etendue-manifest.json ] || cmp "$file" "$home/picture/$name"
done
scontrol show job "${job}_2" | grep -q 'Restarts=[1-9]' || { echo "nothing was requeued" >&2; exit 1; }
echo "eight shares, one of them killed and requeued, make the files of one process"

sweep=$(sbatch --parsable --array=0-1 --chdir "$home/jobs" scenes/cluster/sweep.sbatch \
    "$scene" "$home/sweep" camera.fov 30 60)
wait_until 300 is_done "$sweep"
for fov in 30 60; do
    test -e "$home/sweep/camera.fov=$fov/picture.png"
done
echo "the sweep made a picture a task"
