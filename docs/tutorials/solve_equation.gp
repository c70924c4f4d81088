# Draws the picture of solve_equation.md from the text files:
#   gnuplot solve_equation.gp
set terminal pngcairo size 1200,420
set output "solve_equation.png"
set multiplot layout 1,2
set view map
set pm3d corners2color mean
unset key
set xlabel "t"
set ylabel "x"
set xrange [0:2]
set yrange [-1:1]

set title "u"
splot "solve_equation.txt" using 1:2:3 with pm3d

set title "|u - u*|"
set logscale cb
set format cb "10^{%L}"
set cbrange [1e-11:*]
splot "solve_equation.txt" using 1:2:($4 + 1e-11) with pm3d
