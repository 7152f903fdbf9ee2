/* What table slot A is flashed with: the file that the build names. */
    .section .table_a, "a"
    .balign 8
    .incbin TABLE_A_FILE
