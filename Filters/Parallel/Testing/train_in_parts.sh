# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
#   train_in_parts.sh PYTHON MPIEXEC EXAMPLE FOLDER
"$1" -c 'import mpi4py' || exit 77
"$2" -np 2 --oversubscribe --allow-run-as-root "$1" -m mpi4py "$3" "$4/sweep.igs.mha" "$4/together.vtp" \
  Gaussians=1000 Iterations=20 HoldOut=4 || exit 1
test -s "$4/together.vtp"
