# Draws the picture of write_field_simulator.md from the text files:
#   gnuplot write_field_simulator.gp
set terminal pngcairo size 1200,420
set output "write_field_simulator.png"
set multiplot layout 1,2

set title "depth of the water"
set xlabel "cell"
set xrange [0:127]
set yrange [0.98:1.4]
set key top right noenhanced
plot "flow_states.txt" using 1:2 with lines linewidth 6 \
       linecolor "gray80" title "truth, at the start", \
     "" using 1:3 with lines linewidth 2 \
       linecolor "black" title "measured, at the end", \
     for [i = 4:*] "" using 1:i with lines linewidth 2 linetype i - 3 \
       title columnheader(i)

set title "loss"
set xlabel "seconds"
set ylabel "L"
set logscale xy
set autoscale x
set yrange [1e-15:*]
set format "10^{%L}"
set key bottom left Left reverse noenhanced
plot for [i = 0:*] "flow_losses.txt" index i using 1:2 \
  with lines linewidth 2 linetype i + 1 title columnheader(1)
