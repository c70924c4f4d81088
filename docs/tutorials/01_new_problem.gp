# The picture of tutorial 1, from the file that the program wrote here:
#   gnuplot 01_new_problem.gp
set terminal pngcairo size 800,520
set output "01_new_problem.png"
set title "shuttlecock"
set xlabel "seconds of training"
set ylabel "test loss [m^2]"
set logscale xy
set format y "10^{%L}"
set key outside bottom center horizontal maxcols 2 noenhanced
plot for [i = 0:*] "shuttlecock_losses.txt" index i \
  with lines linewidth 2 title columnheader(1)
