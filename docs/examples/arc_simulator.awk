# Another simulator, in twenty lines: an arc that bends by a polynomial of the pressures' vector sum. Reads a run log, takes its
# measured pressures, and writes the log with the tip's pose that the arc has at them beside what was measured.
#
#   awk -f docs/examples/arc_simulator.awk RUN.csv > WITH_SIM.csv

BEGIN { FS = OFS = "," }
/^#/ { print; next }
!("time_s" in column) {
    for (i = 1; i <= NF; i++) column[$i] = i
    print $0, "sim_tip_x_m,sim_tip_y_m,sim_tip_z_m,sim_tip_qw,sim_tip_qx,sim_tip_qy,sim_tip_qz"
    next
}
{
    p1 = $column["p1_pa"]; p2 = $column["p2_pa"]; p3 = $column["p3_pa"]
    # single readings are noisy; the arc feels them over some ten milliseconds
    s1 += (p1 - s1) * 0.1; s2 += (p2 - s2) * 0.1; s3 += (p3 - s3) * 0.1
    x = -s1 + 0.5 * (s2 + s3); y = sqrt(0.75) * (s3 - s2)  # a chamber pushes the tip away from its side
    across = sqrt(x * x + y * y)
    bend = across * (5.74e-7 + 1.97e-12 * across * across)
    length_m = 0.055 * (1 + 3.4e-6 * (s1 + s2 + s3)); cap = 0.005
    dx = across > 1e-6 ? x / across : 1; dy = across > 1e-6 ? y / across : 0
    off = bend > 1e-6 ? length_m * (1 - cos(bend)) / bend : 0
    up = bend > 1e-6 ? length_m * sin(bend) / bend : length_m
    printf "%s,%.8f,%.8f,%.8f,%.8f,%.8f,%.8f,0\n", $0, dx * (off + cap * sin(bend)), dy * (off + cap * sin(bend)),
        cap + up + cap * cos(bend), cos(bend / 2), -dy * sin(bend / 2), dx * sin(bend / 2)
}
