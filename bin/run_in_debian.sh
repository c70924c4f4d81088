#!/usr/bin/env bash
# Runs a command in a fresh Debian of any release: in a folder that debootstrap
# fills, with a copy of this checkout, by chroot. As root, on Debian, with the
# package mirror of this machine.
#
#   bin/run_in_debian.sh trixie bin/run_tests.sh
#   bin/run_in_debian.sh --arch=arm64 bookworm bin/run_comparison.sh
#
#   --folder=DIR   where the release lies; build/debian/RELEASE, and for another
#                  architecture build/debian/RELEASE-ARCH, if not given
#   --arch=ARCH    an architecture of Debian, emulated by QEMU if it is foreign
#
# A second call uses the same folder: its installed packages, build/ and runs/
# are still there, and the rest of the checkout is copied again. The command runs
# in the copy, with none of this machine's environment variables; its exit code
# is that of this script. `rm -r DIR` ends it; nothing stays mounted.
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

usage() {
  sed -n '2,/^set/ { /^#/ s/^# \{0,1\}//p }' "${BASH_SOURCE[0]}" >&2
  exit 1
}

arch=$(dpkg --print-architecture)
readonly own_arch=$arch
folder=""
while [[ "${1:-}" == --* ]]; do
  case "$1" in
    --arch=?*) arch="${1#*=}" ;;
    --folder=?*) folder="${1#*=}" ;;
    *) usage ;;
  esac
  shift
done
(($# >= 2)) || usage
readonly release="$1" arch
shift
if [[ -z "$folder" ]]; then
  folder="$root/build/debian/$release"
  if [[ "$arch" != "$own_arch" ]]; then folder+="-$arch"; fi
fi
if ((EUID != 0)); then
  echo "chroot and debootstrap need root: run this script as root" >&2
  exit 1
fi

# The mirror of Debian's main component that apt uses on this machine.
mirror() {
  # shellcheck disable=SC2016  # apt-get replaces these variables
  apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' \
    'Origin: Debian' 'Component: main' | grep -v security | head -n 1
}

# Lets the kernel start programs of a foreign architecture by QEMU.
register_emulator() {
  local name
  case "$arch" in
    arm64) name=qemu-aarch64 ;;
    *) name="qemu-$arch" ;;
  esac
  install_missing qemu-user-static
  local -r kernel=/proc/sys/fs/binfmt_misc
  [[ -e $kernel/register ]] || mount -t binfmt_misc binfmt_misc $kernel
  [[ -e $kernel/$name ]] || cat "/usr/lib/binfmt.d/$name.conf" >$kernel/register
}

create() {
  install_missing debootstrap
  rm -rf "$folder.part"
  mkdir -p "$folder.part"
  # In mount namespaces of their own, so that nothing stays mounted.
  unshare --mount debootstrap --variant=minbase --include=ca-certificates \
    --arch="$arch" "$release" "$folder.part" "$(mirror)"
  mv "$folder.part" "$folder"
}

# Files that have changed get the present time, whatever their own is, so that
# build/ is up to date with what it was built from.
copy_checkout() {
  local -r old="$folder/checkout" new="$folder/checkout.new"
  local file
  mkdir -p "$old"
  rm -rf "$new"
  mkdir "$new"
  tar -C "$root" --exclude=./build --exclude=./runs --exclude=./.git -c . |
    tar -C "$new" -x --no-same-owner --touch
  (cd "$new" && find . -type f -print0) | while IFS= read -r -d '' file; do
    if cmp -s "$old/$file" "$new/$file"; then touch -r "$old/$file" "$new/$file"; fi
  done
  for file in build runs; do
    if [[ -e "$old/$file" ]]; then mv "$old/$file" "$new"; fi
  done
  rm -r "$old"
  mv "$new" "$old"
  cp /etc/resolv.conf /etc/hosts "$folder/etc"
}

if [[ "$arch" != "$own_arch" ]]; then register_emulator; fi
[[ -d "$folder" ]] || create
copy_checkout
# MPI needs /dev/shm and the processors that /sys lists.
# shellcheck disable=SC2016  # the inner shell replaces these variables
exec unshare --mount bash -c '
  mount -t proc proc "$0/proc"
  mount --rbind /sys "$0/sys"
  mount --rbind /dev "$0/dev"
  exec env -i HOME=/root LANG=C.UTF-8 TERM="${TERM:-dumb}" \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    chroot "$0" sh -c "cd /checkout && exec \"\$@\"" sh "$@"
' "$folder" "$@"
