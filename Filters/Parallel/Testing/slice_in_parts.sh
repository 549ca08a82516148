# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# The slice has the same bits on one process and on two.
#   slice_in_parts.sh PYTHON MPIEXEC EXAMPLE FOLDER
"$1" -c 'import mpi4py' || exit 77
for n in 1 2; do
  "$2" -np $n --oversubscribe --allow-run-as-root "$1" "$3" "$4/field.vtp" "$4/part-$n.mha" || exit 1
done
cmp "$4/part-1.mha" "$4/part-2.mha"
